/* gait_lift.h - 3-D motion from 2-D keypoints, by a prior over segments of motion (Leventon and Freeman 1998).
 *
 * A segment is F frames of J markers: stature x (mean + sum_i alpha_i mode_i), turned by a heading about z and
 * put at a place on the ground; alpha ~ N(0, I), learnt from motion capture (gait learn --segments).  Which markers a
 * frame shows, and how well, may change from frame to frame.  Arrays are doubles, [F][J][...] by frame. */
#ifndef GAIT_LIFT_H
#define GAIT_LIFT_H
#include "gait.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gait_lift gait_lift;
#define GAIT_MAX_MARKERS 64
#define GAIT_MAX_SEGMENT_FRAMES 64
#define GAIT_MAX_MODES 120  /* of a segment prior */
#define GAIT_MAX_MIXTURE 16 /* Gaussians of a segment prior */
enum { GAIT_LIFT_PERSPECTIVE = 0, GAIT_LIFT_ORTHOGRAPHIC = 1 };

typedef struct gait_lift_info {
    int32_t  markers, frames;   /* J, F */
    int32_t  hop;               /* frames from one segment to the next */
    int32_t  headings;          /* 0: heading is unknown; 2, 8: turned copies were learnt, axes are the world's */
    int32_t  components, modes; /* Gaussians of the mixture, modes of each */
    float    fps;               /* frames per second of a segment */
    float    stature;           /* mean of the people learnt from, metres */
    uint64_t digest;            /* of the blob */
} gait_lift_info;

typedef struct gait_lift_config {
    uint32_t struct_size;     /* set by gait_lift_default() */
    int32_t  projection;      /* GAIT_LIFT_PERSPECTIVE (default): `camera`, u v in pixels; or ORTHOGRAPHIC: `axis`, metres */
    double   stature;         /* metres; default 0: the learners' mean */
    double   stature_sd;      /* metres; default -1: 0.04, or 0.09 where stature is 0; 0: exactly that */
    double   sd;              /* of an observation where none is given, pixels or metres; default 3 */
    double   residual;        /* factor of what the modes leave over [0, 1e4]; default -1: the blob's; 0: the paper's form */
    double   place[3];        /* where the pelvis of the first frame is expected, metres; default 0 (z: of the floor) */
    double   place_sd[3];     /* default 10 10 0.03; 0: exactly there */
    double   heading;         /* of the body in the first frame about z, radians; 0 = along +x */
    double   heading_sd;      /* default -1: unknown, all are tried (blobs with turned copies: 0); 0: exactly `heading` */
    double   turn_sd;         /* by how much a heading may depart from the segment before, radians; default 0.3 */
    double   tolerance;       /* iteration ends below this change, in deviations; default 1e-9 */
    int32_t  max_iterations;  /* [1, 100]; default 30 */
    int32_t  lag;             /* streaming: frames an estimate waits for later ones [0, 64]; default 5; -1: no streaming */
    double   max_rate;        /* streaming: frames per second for which there is room [1, 1000]; default 60 */
    double   max_gap;         /* streaming: longest pause before starting anew, seconds; default 0.5 */
    double   fit_threshold;   /* streaming: a segment that fits worse (squared deviations per number observed) is ambiguous
                               * and, its heading unknown, searched for anew; default 9; 0: never */
    uint64_t report;          /* bit j: marker j is estimated while streaming; default all */
    double   axis[2][3];      /* orthographic: directions of u and v in the world, orthonormal; default x and z */
    gait_camera camera;      /* perspective: t within 1e4 metres along each axis */
    uint32_t cpu_mask;        /* GAIT_CPU_* that may be used, default all, 0: scalar; results do not depend on it */
} gait_lift_config;

typedef struct gait_lift_fit {   /* what one segment's observations say */
    double  log_evidence;        /* log p(observations), nats; of the best heading and component */
    double  log10_volume;        /* log10 of posterior over prior volume of all unknowns, sqrt(det Q / det Lambda) */
    double  chi2;                /* sum of squared residuals in deviations */
    double  heading, heading_sd; /* radians */
    double  place[3];            /* of the pelvis of the first frame, z: of the floor, metres */
    double  share;               /* posterior probability of the component, (0, 1] */
    int32_t component;
    int32_t observed;            /* numbers observed: 2 for each marker seen */
    int32_t iterations;
    int32_t converged;           /* 1, or 0: max_iterations came first */
} gait_lift_fit;

#define GAIT_LIFT_UNOBSERVED 0x1u /* nothing was observed of the segments behind this estimate: it is the prior's */
#define GAIT_LIFT_POOR_FIT 0x2u /* a segment behind it fits worse than config fit_threshold (the first: half), or was searched for anew */
typedef struct gait_lift_frame { /* one frame of a stream, `lag` frames ago */
    int64_t  utime;              /* its capture time */
    uint64_t frame;              /* frames pushed before it since the start */
    double   heading;            /* of the body, radians */
    double   chi2_per_observation; /* squared deviations per number observed of the segments behind it */
    int32_t  status;             /* GAIT_TRACK_TRACKING; AMBIGUOUS: as GAIT_LIFT_POOR_FIT; INIT: none yet, all below is 0 */
    uint32_t flags;              /* GAIT_LIFT_* */
    double   marker[GAIT_MAX_MARKERS][3]; /* posterior mean, metres, world; 0 for those not in config report */
    double   sd[GAIT_MAX_MARKERS][3];     /* standard deviation; wider by the root of a chi2_per_observation above 1 */
} gait_lift_frame;

/* Of the model's segment prior; GAIT_ERR_ARG: it has none. */
GAIT_API gait_result gait_lift_get_info(const gait_model *m, gait_lift_info *out, gait_error *err);
GAIT_API void        gait_lift_default(gait_lift_config *cfg);
/* The model must outlive the lifter. */
GAIT_API gait_result gait_lift_bytes(const gait_model *m, const gait_lift_config *cfg, size_t *bytes,
                                     gait_error *err);
GAIT_API gait_result gait_lift_init(void *mem, size_t mem_bytes, const gait_model *m, const gait_lift_config *cfg,
                                    gait_lift **out, gait_error *err);
GAIT_API const char *gait_lift_marker_name(const gait_lift *l, int32_t marker); /* NULL out of range */

/* One segment.  uv [F][J][2]; sd [F][J] or NULL (config sd): infinite, NaN or <= 0 is not seen, as is a uv
 * that is NaN, beyond 1e6 or, in perspective, exactly 0, 0 or -1, -1, where detectors put what they do not see. */
GAIT_API gait_result gait_lift_segment(gait_lift *l, const double *uv, const double *sd, gait_lift_fit *out,
                                       gait_error *err);
/* The same with outliers down-weighted: a point beyond four standard deviations of the fit keeps little influence.
 * weighted [F][J] receives the deviations that count, above `sd` for outliers.  If outliers may have misled the search
 * it is repeated with all points down-weighted at first. */
GAIT_API gait_result gait_lift_segment_robust(gait_lift *l, const double *uv, const double *sd, double *weighted,
                                              gait_lift_fit *out, gait_error *err);
/* Expect the person of the following segments at another place and heading than the config's; heading_sd as there.
 * GAIT_ERR_STATE: the lifter was not made for an unknown heading. */
GAIT_API gait_result gait_lift_expect(gait_lift *l, const double place[3], double heading, double heading_sd,
                                      gait_error *err);
/* Of the last gait_lift_segment() (GAIT_ERR_STATE without one): posterior mean [F][J][3] and standard deviation (may
 * be NULL), metres, world; */
GAIT_API gait_result gait_lift_positions(gait_lift *l, double *mean, double *sd, gait_error *err);
/* the unknowns [n], n = gait_lift_unknowns(), prior N(0, 1) each: modes, place x y z, stature and heading if they are
 * unknown; and their covariance [n][n] (may be NULL); */
GAIT_API int32_t     gait_lift_unknowns(const gait_lift *l);
GAIT_API gait_result gait_lift_posterior(gait_lift *l, double *mean, double *covariance, gait_error *err);
/* by what deviations are to be multiplied for a motion as far from the prior's mean as this one: above 1 where its
 * modes are larger than the prior expects, below 1 where they are smaller. Of a parallel view, heading
 * and size known, errors are then about Student's t of ten degrees: 90 % within 1.81. Takes milliseconds; */
GAIT_API gait_result gait_lift_scale(gait_lift *l, double *scale, gait_error *err);
/* what the observations alone say, the least-squares fit of minimum norm [F][J][3] (fig. 5c); */
GAIT_API gait_result gait_lift_least_squares(gait_lift *l, double *mean, gait_error *err);
/* the `count` most uncertain displacements [count][F][J][3], one deviation long, metres, and their deviations
 * [count] over all markers (fig. 6). */
GAIT_API gait_result gait_lift_uncertain(gait_lift *l, int32_t count, double *mode, double *sd, gait_error *err);

/* Many segments with the same visibility: orthographic, heading known, component 0.  gait_lift_fix() computes the gain
 * for sd [F][J]; gait_lift_batch() then takes uv [count][F][J][2] to mean [count][F][J][3]; deviations are those of
 * gait_lift_positions() after gait_lift_fix(). */
GAIT_API gait_result gait_lift_fix(gait_lift *l, const double *sd, gait_error *err);
GAIT_API gait_result gait_lift_batch(gait_lift *l, int32_t count, const double *uv, double *mean, gait_error *err);

/* A stream: one frame uv [J][2], sd [J] or NULL; utime must increase.  Segments begin every hop / fps seconds from the
 * first frame on; each frame is added to those that it falls into, at its own time (linear between their frames).
 * Points far from where the segments have them, as wrong detections are, have little or nothing to say. */
GAIT_API gait_result gait_lift_push(gait_lift *l, int64_t utime, const double *uv, const double *sd, gait_error *err);
/* The frame `lag` frames before the last one pushed.  GAIT_ERR_STATE: not so many frames since the start. */
GAIT_API gait_result gait_lift_estimate(gait_lift *l, gait_lift_frame *out, gait_error *err);
GAIT_API void        gait_lift_reset(gait_lift *l); /* forget the stream */

/* Tools for sequences of 2-D points, without a lifter.  Both return how many points they found.
 * Spikes: points far off the line through the same point's neighbours in time, by its own noise and acceleration; their
 * sd [frames][points] becomes -1.  time [frames] increases; uv [frames][points][2]; scratch [2 frames]. */
GAIT_API int32_t gait_lift_remove_spikes(int32_t frames, int32_t points, const double *time, const double *uv, double *sd,
                                         double *scratch);
/* Outliers: points of one frame whose distance from their prediction, squared, in standard deviations, is above 16 and
 * above 9 times the frame's median; sd [points] grows with it, so that their pull falls with its third power.
 * scratch [points]. */
GAIT_API int32_t gait_lift_weight_outliers(int32_t points, const double *square, double *sd, double *scratch);

#ifdef __cplusplus
}
#endif
#endif
