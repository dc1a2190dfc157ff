/* gait.h - libgait: track walking people in calibrated video, in fixed memory, with the same bits on every run.
 *
 * Units: metres, radians, seconds, pixels; a name ending in utime is microseconds (as in LCM).  Matrices are
 * row-major.  World: right-handed, z up, ground z = 0.  Image row 0 is the top; pixel centres are at integers.
 * Memory: the library never allocates.  Ask gait_*_bytes(), give gait_*_init() that many bytes aligned to
 * GAIT_ALIGN; they must outlive the object and not move.  There is nothing to free.
 * Threads: a gait_model is immutable and may be shared; any other object takes one call at a time.
 * Results depend on input, configuration and seed - not on threads, addresses, time or CPU features.
 * Every function returning gait_result gives GAIT_OK or a negative error and then leaves its outputs alone. */
#ifndef GAIT_H
#define GAIT_H
#include <stddef.h>
#include <stdint.h>

#define GAIT_VERSION_MAJOR 0
#define GAIT_VERSION_MINOR 1
#define GAIT_VERSION_PATCH 0
#define GAIT_VERSION (GAIT_VERSION_MAJOR * 10000 + GAIT_VERSION_MINOR * 100 + GAIT_VERSION_PATCH)
#define GAIT_ABI 7          /* SONAME; bumped by any incompatible change below, struct layout included */
#define GAIT_FORMAT_MAJOR 1 /* model blob: another major is refused, */
#define GAIT_FORMAT_MINOR 0 /* sections added by a newer minor are skipped */

#define GAIT_ALIGN 64
#define GAIT_MAX_JOINTS 32     /* points of the skeleton whose positions are reported */
#define GAIT_MAX_ANGLES 32     /* joint angles */
#define GAIT_MAX_COMPONENTS 16 /* principal components of the cyclic model */
#define GAIT_MAX_PROPORTIONS 8 /* ways in which limbs differ in length */
#define GAIT_MAX_CAMERAS 4

#if defined(__GNUC__)
#define GAIT_API __attribute__((visibility("default")))
#else
#define GAIT_API
#endif
#ifdef __cplusplus
extern "C" {
#endif

/* ---- status: 0 success, negative error.  Values never change meaning. -------------------------------- */
typedef enum gait_result {
    GAIT_OK          = 0,
    GAIT_ERR_ARG     = -1, /* null pointer, non-finite number, value outside its documented range */
    GAIT_ERR_STRUCT  = -2, /* struct_size unset or unknown: call gait_*_default() first */
    GAIT_ERR_MEMORY  = -3, /* mem too small or not aligned to GAIT_ALIGN */
    GAIT_ERR_LIMIT   = -4, /* of tracker, pool, model: a count or size out of its range, as particles 0, lag -1, tasks 0 */
    GAIT_ERR_MAGIC   = -5, /* not a libgait blob or snapshot */
    GAIT_ERR_VERSION = -6, /* format major or snapshot layout is not the one this build reads */
    GAIT_ERR_CORRUPT = -7, /* checksum, bounds or cross-reference check failed */
    GAIT_ERR_STATE   = -8, /* call out of order: step before start, time running backwards */
    GAIT_ERR_NUMERIC = -9  /* lifting ran out of the range of numbers; the tracker flags GAIT_EST_DEGENERATE instead */
} gait_result;

typedef struct gait_error { /* optional detail, written on failure only; there is no global "last error" */
    int32_t result;         /* the gait_result returned */
    int32_t index;          /* camera, section or parameter concerned; -1 if none */
    char    text[120];      /* one line, NUL-terminated */
} gait_error;

typedef struct gait_abi_field { /* one row per struct (field "") and per field */
    char     type[20], field[24];
    uint32_t offset, size;      /* bytes */
} gait_abi_field;

GAIT_API const char           *gait_result_name(gait_result s);  /* "GAIT_ERR_CORRUPT"; never NULL */
GAIT_API uint32_t              gait_version(void);               /* of the library that is loaded */
GAIT_API uint32_t              gait_abi(void);
GAIT_API const gait_abi_field *gait_abi_fields(uint32_t *count); /* bindings check themselves on import */

/* Instruction sets.  The best of those that the CPU and a tracker's config cpu_mask have is used. */
#define GAIT_CPU_BASE   0x1u /* of every CPU of the architecture: SSE2, NEON */
#define GAIT_CPU_AVX2   0x2u /* and POPCNT, BMI2 */
#define GAIT_CPU_AVX512 0x4u /* F, BW, DQ, VL, VBMI, VPOPCNTDQ, BITALG */
GAIT_API uint32_t    gait_cpu_features(void);      /* GAIT_CPU_* of this CPU and build */
GAIT_API const char *gait_cpu_name(uint32_t mask); /* what cpu_mask gives here: "scalar", "base", "avx2" or "avx512" */

/* ---- plain data -------------------------------------------------------------------------------------- */
enum { GAIT_GREY8 = 1, GAIT_RGB8 = 2, GAIT_BGR8 = 3 };
typedef struct gait_image { /* borrowed view */
    const uint8_t *data;    /* NULL: no image */
    int32_t width, height;  /* pixels */
    int32_t stride;         /* bytes per row */
    int32_t format;         /* GAIT_GREY8, GAIT_RGB8 or GAIT_BGR8 */
} gait_image;

typedef struct gait_camera { /* u = fx X/Z + cx, v = fy Y/Z + cy with (X,Y,Z) = R p + t */
    int32_t width, height;   /* pixels, [1, 16000] */
    float   fx, fy, cx, cy;  /* pixels */
    float   R[9], t[3];      /* world to camera; metres */
    float   distortion[5];   /* k1 k2 p1 p2 k3 (OpenCV); applied to the incoming frame */
} gait_camera;

typedef struct gait_state {          /* one hypothesis: everything that places and poses a walker */
    float phase;                     /* [0, 1) of the stride; 0 = right heel strike */
    float stride_hz;                 /* strides per second, [0.1, 4] in starts; in poses 0 stands for the model's mean */
    float stature;                   /* metres, [0.5, 2.5] in starts */
    float heading;                   /* walking direction about world z, radians, [-7, 7] in starts; 0 = along +x */
    float pitch, roll;               /* tilt of the pelvis beyond the model's own, radians */
    float turn_rate;                 /* of the heading, radians per second; has no part in poses */
    float pelvis[3];                 /* pelvis joint, metres, world, [-1e4, 1e4] in starts */
    float coef[GAIT_MAX_COMPONENTS]; /* principal-component scores, in standard deviations; unused are 0 */
    float offset[GAIT_MAX_ANGLES];   /* posture: added to the model's joint angles, radians; unused are 0 */
    float proportion[GAIT_MAX_PROPORTIONS]; /* scores of the limbs' proportions, standard deviations; unused are 0 */
} gait_state;

typedef struct gait_pose {
    float joint[GAIT_MAX_JOINTS][3]; /* metres, world; order of gait_model_joint_name() */
    float angle[GAIT_MAX_ANGLES];    /* radians; order of gait_model_angle_name() */
} gait_pose;

/* ---- tasks: where the library finds threads ---------------------------------------------------------- */
typedef void gait_task_fn(void *ctx, int32_t task);
typedef struct gait_tasks {
    /* Call fn(ctx, i) exactly once for each i in [0, count), in any order, on any threads; return when all
     * have returned.  NULL: the calling thread does the work. */
    void (*run)(void *user, gait_task_fn *fn, void *ctx, int32_t count);
    void *user;
} gait_tasks;

/* ---- model: immutable view of a blob, used where it lies ---------------------------------------------- */
typedef struct gait_model gait_model;
typedef struct gait_model_info {
    int32_t  joints, angles;   /* reported points and joint angles */
    int32_t  components;       /* of the cyclic model */
    int32_t  phases;           /* samples per stride of its curves */
    int32_t  limbs;            /* drawn body parts */
    int32_t  proportions;      /* ways in which limbs differ in length at the same stature */
    float    stride_hz;        /* mean of the training set, strides per second */
    float    stride_hz_sd;     /* between subjects */
    float    stride_length;    /* mean, as a fraction of stature */
    float    stride_length_sd; /* between subjects */
    int32_t  cyclic;           /* 1: it can be tracked with; 0: it has a segment prior alone, all above is 0 */
    uint32_t posture_angles;   /* bit i: angle i is of trunk or arms, whose posture differs most between people */
    uint64_t digest;           /* of the blob; snapshots carry it */
} gait_model_info;

/* The blob must be aligned to GAIT_ALIGN and outlive the model. */
GAIT_API gait_result gait_model_bytes(const void *blob, size_t blob_bytes, size_t *bytes, gait_error *err);
GAIT_API gait_result gait_model_init(void *mem, size_t mem_bytes, const void *blob, size_t blob_bytes,
                                     gait_model **out, gait_error *err);
GAIT_API gait_result gait_model_get_info(const gait_model *m, gait_model_info *out, gait_error *err);
GAIT_API const char *gait_model_joint_name(const gait_model *m, int32_t joint); /* NULL out of range */
GAIT_API const char *gait_model_angle_name(const gait_model *m, int32_t angle); /* NULL out of range */
GAIT_API const char *gait_model_limb_name(const gait_model *m, int32_t limb);   /* NULL out of range */
/* Bit i for each angle i that is named; names are separated by spaces. */
GAIT_API gait_result gait_model_angle_mask(const gait_model *m, const char *names, uint32_t *mask, gait_error *err);
/* Pose of one hypothesis: curves (Ormoneit 2000, eq. 3), then forward kinematics. */
GAIT_API gait_result gait_model_pose(const gait_model *m, const gait_state *s, gait_pose *out, gait_error *err);
/* Height of the pelvis over the ground that the model predicts for s (s->pelvis is not read), metres. */
GAIT_API gait_result gait_model_pelvis_height(const gait_model *m, const gait_state *s, float *out, gait_error *err);

/* ---- render: limbs with depth order ------------------------------------------------------------------- */
/* Draw a hypothesis with the model's own radii: every pixel of ids (width x height of the camera, ids_stride
 * bytes per row) becomes 0 or limb index + 1, nearest limb in front (ideal pinhole image, no distortion). */
GAIT_API gait_result gait_render(const gait_model *m, const gait_camera *cam, const gait_state *s, uint8_t *ids,
                                 int32_t ids_stride, gait_error *err);

/* ---- tracker (Ormoneit et al. 2000) ------------------------------------------------------------------- */
typedef struct gait_tracker gait_tracker;
enum { GAIT_MODE_DEFAULT = 0, GAIT_MODE_PAPER = 1 };
#define GAIT_TERM_TEXTURE    0x1u /* previous frame's texture moved by each particle, eqs. 10-13 */
#define GAIT_TERM_SILHOUETTE 0x2u /* foreground both ways; needs a background plate */
#define GAIT_TERM_EDGES      0x4u /* image gradient along the limbs' outlines */
#define GAIT_TERM_TEMPLATE   0x8u /* running appearance of each limb */
#define GAIT_TERM_KEYPOINTS     0x10u /* joints found in the images by somebody else, gait_frame keypoints; default off */

typedef struct gait_tracker_config {
    uint64_t struct_size;      /* set by gait_tracker_default() */
    uint64_t seed;             /* default 1 */
    int64_t  offset_angles;    /* bit i: angle i has a posture, past the model's nothing (gait_model_angle_mask());
                                * default -1: those of gait_model_info posture_angles (paper mode 0) */
    int32_t  mode;             /* GAIT_MODE_*; set by gait_tracker_default() */
    int32_t  particles;        /* [16, 1 << 20]; default 2000 (paper mode 10000) */
    int32_t  acquisition_particles; /* twice as many in a search, up to these [0, 1 << 20]; default 4000 (paper mode 0) */
    int32_t  components;       /* [0, the model's]; default -1: the first 5, in paper mode all */
    int32_t  tasks;            /* [1, 256], as many as exec has threads; each takes 0.1 MB if exec is set; default 8 */
    int32_t  cameras;          /* [1, GAIT_MAX_CAMERAS]; default 1 */
    int32_t  lag;              /* frames that gait_tracker_lagged() can go back [0, 64]; default 5; 0: none */
    int32_t  proportions;      /* [0, the model's]; -1: all; default 0 (doc/decisions.md says why) */
    uint32_t terms;            /* GAIT_TERM_* in use; default all but tracks (paper mode texture alone) */
    float    term_weight[5];   /* nats per unit cost of texture, silhouette, edges, template, tracks, each [0, 1e6];
                                * default 0.2 (paper mode 1), 25, 40, 4, 8 */
    float    missed_weight;    /* cost of foreground that the body leaves out, 1: as much as background inside of it
                                * [0, 1]; default 0.6 */
    float    girth;            /* limb radii, as a multiple of the model's, which clothes widen [0.5, 2]; default 1 */
    float    resample_ess;     /* resample when the effective sample size is below this fraction of the particles
                                * [0, 1]; default 0.5 (paper mode 1: every frame) */
    float    evidence_time;    /* seconds for which errors of the image terms last; a frame's log-likelihood counts at
                                * the time since images last supported the walker / this, at most whole; 0: frames are
                                * independent [0, 1e6]; default 0.1 (paper mode 0) */
    float    rejuvenation_time;      /* seconds in which particles forget whom they descend from; 0: never [0, 1e6]; default
                                * 1.5 (paper mode 0) */
    float    max_dt;           /* longest accepted interval, seconds [0.001, 10]; default 0.5 */
    /* Dynamics (eqs. 5-9): standard deviations of random walks, per sqrt(second). */
    float    phase_noise;      /* strides [0, 10]; default 0.0164 (paper mode 0.022) */
    float    rate_noise;       /* fraction of the model's mean stride_hz [0, 10]; default 0.055 */
    float    settle_time;      /* seconds of settling, from when phase, left and right are known [0, 1e6]; default 1 */
    float    rate_time;        /* seconds in which it returns to the mean; 0: never [0, 1e6]; default 3 (paper mode 0) */
    float    forward_noise;    /* of the pelvis along the heading, metres [0, 100]; default 0.08 (paper mode 0.044) */
    float    lateral_noise;    /* across it, metres [0, 100]; default 0.02 (paper mode 0.044) */
    float    vertical_noise;   /* metres [0, 100]; default 0.0096 (paper mode 0.022) */
    float    heading_noise;    /* radians [0, 100]; default 0.044 (paper mode 0.11) */
    float    turn_sd;          /* of turn rates, radians per second [0, 100]; default 0.5 (paper mode 0) */
    float    turn_time;        /* mean seconds until it changes, half to 0; 0: never [0, 1e6]; default 6 (paper mode 0) */
    float    tilt_noise;       /* of pitch and roll, radians [0, 100]; default 0.033 (paper mode 0.055) */
    float    tilt_time;        /* seconds in which they and the height return; 0: never [0, 1e6]; default 1.1 (paper mode 0) */
    float    coef_noise;       /* standard deviations of a score [0, 100]; default 0.667 (paper mode 0.5) */
    float    coef_time;        /* seconds in which they return; 0: never [0, 1e6]; default 4.5 (paper mode 0) */
    float    stature_noise;    /* deviations of stature at the start [0, 100]; default 0.2 (paper mode 0) */
    float    stature_noise_start; /* the same while settling [0, 100]; default 2 (paper mode 0) */
    float    offset_noise;     /* posture of the angles in offset_angles, in the deviation among people learnt of each
                                * angle, which it relaxes to [0, 100]; default 0.58 */
    float    proportion_noise; /* of the proportions' scores, which relax to a deviation of 1 [0, 100]; default 0.15 */
    uint32_t cpu_mask;         /* GAIT_CPU_* that may be used, default all, 0: scalar; results do not depend on it */
    float    joint_sd_model;   /* in reported joint_sd, in quadrature: what the model cannot express, fraction of
                                * stature [0, 1]; default 0.015 (paper mode 0) */
    gait_camera camera[GAIT_MAX_CAMERAS];
    gait_tasks exec;           /* default { NULL, NULL } */
} gait_tracker_config;

typedef struct gait_keypoint { /* one joint located in an image */
    float u, v; /* pixels, as captured (distorted) */
    float sd;   /* standard deviation, pixels, with what the model's joints miss the detector's by; not positive: not seen */
} gait_keypoint;

typedef struct gait_frame {
    int64_t    utime;                   /* capture time; must increase */
    gait_image image[GAIT_MAX_CAMERAS]; /* data NULL: that camera missed this frame */
    const gait_keypoint *keypoints[GAIT_MAX_CAMERAS]; /* the model's joints in order, for GAIT_TERM_KEYPOINTS; NULL: none.  They
                                                 * count where the camera has an image */
} gait_frame;

enum { GAIT_TRACK_INIT = 0, GAIT_TRACK_TRACKING = 1, GAIT_TRACK_AMBIGUOUS = 2, GAIT_TRACK_LOST = 3 };
#define GAIT_EST_RESAMPLED  0x1u
#define GAIT_EST_NO_IMAGE   0x2u /* prediction only */
#define GAIT_EST_DEGENERATE 0x4u /* effective sample size below 2 */
typedef struct gait_estimate {
    int64_t    utime;
    uint64_t   frame;       /* steps since start */
    double     log_evidence; /* log p(frame | past), as the frame counts (config evidence_time), up to a constant */
    gait_state mean;        /* of the dominant mode: circular in phase and heading */
    gait_state sd;          /* over all particles, field by field; circular for phase and heading */
    gait_state best;        /* heaviest particle */
    gait_pose  pose;        /* joints: posterior mean (paper mode: no root motion); angles: of the mode */
    float      joint_sd[GAIT_MAX_JOINTS][3]; /* standard deviation, metres: with what the model cannot
                                                express (joint_sd_model) and, of one camera, the size in doubt */
    float      ess;         /* effective sample size after weighting */
    float      phase_r;     /* resultant length of the phase, [0, 1]: 1 = certain */
    float      hypothesis_weight; /* of the dominant hypothesis, [0, 1] */
    float      speed;       /* metres per second along the ground */
    int32_t    status;      /* GAIT_STATUS_* */
    uint32_t   flags;       /* GAIT_EST_* */
} gait_estimate;

GAIT_API void        gait_tracker_default(gait_tracker_config *cfg, int32_t mode);
GAIT_API gait_result gait_tracker_bytes(const gait_model *m, const gait_tracker_config *cfg, size_t *bytes,
                                        gait_error *err);
GAIT_API gait_result gait_tracker_init(void *mem, size_t mem_bytes, const gait_model *m,
                                       const gait_tracker_config *cfg, gait_tracker **out, gait_error *err);
/* Empty scene of one camera, as captured (distorted), borrowed: its pixels must stay until replaced or the tracker is
 * done; snapshots lack it, restore keeps this tracker's.  plate NULL: none; the silhouette term is then silent. */
GAIT_API gait_result gait_tracker_set_background(gait_tracker *t, int32_t camera, const gait_image *plate,
                                                gait_error *err);
/* Broad prior: phase uniform, stride rate and stature of the population, heading unknown, pelvis at the origin. */
GAIT_API gait_result gait_tracker_prior(const gait_model *m, gait_state *mean, gait_state *sd, gait_error *err);
/* Draw the particles from independent normals; a phase or heading whose sd is >= a half turn is uniform.  GAIT_ERR_ARG:
 * a number is out of range: deviations [0, 10]; means as said at gait_state, phase [0, 1], the others [-10, 10]. */
GAIT_API gait_result gait_tracker_start(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime,
                                        gait_error *err);
/* One frame: resample, predict, weigh, estimate.  The first frame after start at the same utime is not moved. */
GAIT_API gait_result gait_tracker_step(gait_tracker *t, const gait_frame *frame, gait_estimate *out, gait_error *err);
/* The frame `back` steps ago given every frame since: today's weights on the ancestors of then.  back 0 is the
 * present.  GAIT_ERR_ARG: back is not in [0, config lag]; GAIT_ERR_STATE: not so many steps since start.  ess counts
 * the ancestors that are left; status is LOST if it was, else the mode's mass as known now decides. */
GAIT_API gait_result gait_tracker_lagged(gait_tracker *t, int32_t back, gait_estimate *out, gait_error *err);
/* Go on with so many particles [16, config particles], drawn in the next step from those there are by their weights;
 * while the two readings of left and right are weighed against each other the change waits.  A start keeps it. */
GAIT_API gait_result gait_tracker_set_particles(gait_tracker *t, int32_t particles, gait_error *err);
/* Copy up to cap particles with normalised weights; returns how many there are, or a negative status. */
GAIT_API int32_t     gait_tracker_particles(const gait_tracker *t, gait_state *s, float *weight, int32_t cap,
                                           gait_error *err);
GAIT_API uint64_t    gait_tracker_digest(const gait_tracker *t); /* hash of the whole state, for replay */
GAIT_API gait_result gait_tracker_save(const gait_tracker *t, void *mem, size_t cap, size_t *bytes,
                                      gait_error *err); /* mem NULL: size */
GAIT_API gait_result gait_tracker_restore(gait_tracker *t, const void *mem, size_t bytes, gait_error *err);

#ifdef __cplusplus
}
#endif
#endif
