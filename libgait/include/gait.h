/* gait.h - libgait: track walking people in calibrated video, in fixed memory, with the same bits on every run.
 *
 * Units: metres, radians, seconds, pixels; names ending in utime are in microseconds (as in LCM).  Matrices are
 * row-major.  World: right-handed, z up, ground z = 0.  Image row 0 is the top; pixel centres are at integers.
 * Memory: the library never allocates.  Call gait_*_bytes(), and give gait_*_init() that many bytes, aligned to
 * GAIT_ALIGN.  They must outlive the object and must not move.  There is nothing to free.
 * Threads: a gait_model is immutable and may be shared; any other object takes one call at a time.
 * Results depend on input, configuration and seed - not on threads, addresses, time or CPU features.
 * Errors: a function that returns gait_result returns GAIT_OK, or a negative error and then leaves its outputs
 * unchanged.  Its last parameter, `err`, may be NULL; on failure it receives one line of text.
 *
 * Contents: errors, images and cameras, models, the tracker; then, for advanced use, instruction sets, further calls
 * of the tracker, and a description of every struct for bindings.  Lifting is in gait_lift.h, the automatic start in
 * gait_start.h, threads in gait_pool.h. */
#ifndef GAIT_H
#define GAIT_H
#include <stddef.h>
#include <stdint.h>

#define GAIT_VERSION_MAJOR 0
#define GAIT_VERSION_MINOR 1
#define GAIT_VERSION_PATCH 0
#define GAIT_VERSION (GAIT_VERSION_MAJOR * 10000 + GAIT_VERSION_MINOR * 100 + GAIT_VERSION_PATCH)
#define GAIT_ABI 10         /* SONAME; raised by any incompatible change below, including struct layout */
#define GAIT_FORMAT_MAJOR 1 /* of model blobs: one with another major version is rejected */
#define GAIT_FORMAT_MINOR 0 /* sections that a newer minor version adds are skipped */

#define GAIT_ALIGN 64          /* bytes, of models and of all memory given to the library */
#define GAIT_MAX_JOINTS 32     /* points of the skeleton whose positions are reported */
#define GAIT_MAX_ANGLES 32     /* joint angles */
#define GAIT_MAX_COMPONENTS 16 /* principal components of the cyclic model */
#define GAIT_MAX_PROPORTIONS 8 /* components of the variation of limb lengths */
#define GAIT_MAX_CLASSES 8     /* classes of motion in a model */
#define GAIT_MAX_PIXELS 16000  /* width and height of a camera's images */
#define GAIT_MAX_CAMERAS 4

#if defined(__GNUC__)
#define GAIT_API __attribute__((visibility("default")))
#else
#define GAIT_API
#endif
/* Enumerations have the same size in C and C++; C++ and C23 fix it in the type. */
#if defined(__cplusplus) || (defined(__STDC_VERSION__) && __STDC_VERSION__ >= 202311L)
#define GAIT_ENUM(name) enum name : int32_t
#else
#define GAIT_ENUM(name) enum name
#endif
#ifdef __cplusplus
extern "C" {
#endif

/* Each struct is written as a table with one row per field.  Declaration, defaults, range checks, bindings and the help
 * of the tools are all generated from the rows, so each fact is stated once.  A row is one of
 *     FIELD("meaning", type, name, [array], "unit")
 *     RANGE("meaning", type, name, [array], "unit", lowest, highest)
 *     SETTING("meaning", type, name, [array], "unit", default, lowest, highest)
 *     PAPER("meaning", type, name, [array], "unit", default, default of GAIT_MODE_PAPER, lowest, highest)
 * with an empty [array] for a single value, and NAN if no range is checked. */
#define GAIT_DECLARE(meaning, type, name, array, ...) type name array;
#define GAIT_VALUES(...) {__VA_ARGS__} /* default of an array */

/* ---- errors ------------------------------------------------------------------------------------------ */
typedef GAIT_ENUM(gait_result) { /* values never change their meaning */
    GAIT_OK          = 0,
    GAIT_ERR_ARG     = -1, /* null pointer, non-finite number, value outside its documented range */
    GAIT_ERR_STRUCT  = -2, /* struct_size unset or unknown: call gait_*_default() first */
    GAIT_ERR_MEMORY  = -3, /* memory too small or not aligned to GAIT_ALIGN */
    GAIT_ERR_LIMIT   = -4, /* whole number or size outside its documented range: particles 0, lag -1, 17000 pixels */
    GAIT_ERR_MAGIC   = -5, /* not a libgait blob or snapshot */
    GAIT_ERR_VERSION = -6, /* model format or snapshot of a version that this library does not read */
    GAIT_ERR_CORRUPT = -7, /* checksum, bounds or cross-reference check failed */
    GAIT_ERR_STATE   = -8, /* call out of order: step before start, time running backwards */
    GAIT_ERR_NUMERIC = -9  /* numbers out of range while lifting; the tracker sets GAIT_EST_DEGENERATE instead */
} gait_result;

/* Detail of a failure; written on failure only. */
#define GAIT_ERROR_FIELDS(FIELD)                                                                                      \
    FIELD("Result that the call returned.",                                                                           \
          gait_result, result, , "")                                                                                  \
    FIELD("Camera, section or parameter concerned; -1: none.",                                                        \
          int32_t, index, , "")                                                                                       \
    FIELD("One line, NUL-terminated.",                                                                                \
          char, text, [120], "")

typedef struct gait_error { GAIT_ERROR_FIELDS(GAIT_DECLARE) } gait_error;

GAIT_API const char *gait_result_name(gait_result s); /* "GAIT_ERR_CORRUPT"; never NULL */
GAIT_API uint32_t    gait_version(void);              /* of the library that is loaded */
GAIT_API uint32_t    gait_abi(void);

/* ---- images, cameras, poses -------------------------------------------------------------------------- */
typedef GAIT_ENUM(gait_pixel_format) { GAIT_GREY8 = 1, GAIT_RGB8 = 2, GAIT_BGR8 = 3 } gait_pixel_format;

/* An image owned by the caller. */
#define GAIT_IMAGE_FIELDS(FIELD)                                                                                      \
    FIELD("Pixels, first row first; NULL: no image.",                                                                 \
          const uint8_t *, data, , "")                                                                                \
    FIELD("Width.",                                                                                                   \
          int32_t, width, , "pixels")                                                                                 \
    FIELD("Height.",                                                                                                  \
          int32_t, height, , "pixels")                                                                                \
    FIELD("Distance from one row to the next.",                                                                       \
          int32_t, stride, , "bytes")                                                                                 \
    FIELD("Layout of a pixel.",                                                                                       \
          gait_pixel_format, format, , "")

typedef struct gait_image { GAIT_IMAGE_FIELDS(GAIT_DECLARE) } gait_image;

/* A calibrated camera: u = fx X/Z + cx, v = fy Y/Z + cy with (X, Y, Z) = R p + t. */
#define GAIT_CAMERA_FIELDS(FIELD)                                                                                     \
    FIELD("Width of its images, 1 to 16000.",                                                                         \
          int32_t, width, , "pixels")                                                                                 \
    FIELD("Height of its images, 1 to 16000.",                                                                        \
          int32_t, height, , "pixels")                                                                                \
    FIELD("Focal length along u, 1e-3 to 1e9.",                                                                       \
          float, fx, , "pixels")                                                                                      \
    FIELD("Focal length along v, 1e-3 to 1e9.",                                                                       \
          float, fy, , "pixels")                                                                                      \
    FIELD("Principal point, u, within 1e6 of 0.",                                                                     \
          float, cx, , "pixels")                                                                                      \
    FIELD("Principal point, v, within 1e6 of 0.",                                                                     \
          float, cy, , "pixels")                                                                                      \
    FIELD("Rotation from world to camera, row-major.",                                                                \
          float, R, [9], "")                                                                                          \
    FIELD("World origin in camera coordinates, each within 1e4.",                                                     \
          float, t, [3], "metres")                                                                                    \
    FIELD("Lens distortion k1 k2 p1 p2 k3 as in OpenCV, each within 1e3; images are as captured.",                        \
          float, distortion, [5], "")

typedef struct gait_camera { GAIT_CAMERA_FIELDS(GAIT_DECLARE) } gait_camera;

/* GAIT_ERR_ARG, with the fault and its remedy, for a camera whose numbers are not valid, or in whose picture no person
 * who stands on the floor, z = 0, would be upright, such as one in millimetres, below the floor, or with another axis up.
 * Trackers accept the second kind, so check a camera before use. */
GAIT_API gait_result gait_camera_check(const gait_camera *camera, gait_error *err);

/* State of a person: position and pose of the body.  gait_tracker_start() checks the ranges. */
#define GAIT_STATE_FIELDS(RANGE)                                                                                      \
    RANGE("Phase of the stride in [0, 1); 0: right heel strike.",                                                     \
          float, phase, , "strides", 0, 1)                                                                            \
    RANGE("Stride rate; in poses 0 stands for the model's mean.",                                                     \
          float, stride_hz, , "strides per second", 0.1, 4)                                                           \
    RANGE("Height of the body.",                                                                                      \
          float, stature, , "metres", 0.5, 2.5)                                                                       \
    RANGE("Walking direction about world z; 0: along +x.",                                                            \
          float, heading, , "radians", -7, 7)                                                                         \
    RANGE("Tilt of the pelvis about its lateral axis relative to the model's.",                                       \
          float, pitch, , "radians", -10, 10)                                                                         \
    RANGE("Tilt of the pelvis about its forward axis relative to the model's.",                                       \
          float, roll, , "radians", -10, 10)                                                                          \
    RANGE("Rate of change of the heading; poses do not depend on it.",                                                \
          float, turn_rate, , "radians per second", -10, 10)                                                          \
    RANGE("Pelvis joint in the world.",                                                                               \
          float, pelvis, [3], "metres", -1e4, 1e4)                                                                    \
    RANGE("Principal-component scores; unused ones are 0.",                                                           \
          float, coef, [GAIT_MAX_COMPONENTS], "standard deviations", -10, 10)                                         \
    RANGE("Posture: added to the model's joint angles; unused ones are 0.",                                           \
          float, offset, [GAIT_MAX_ANGLES], "radians", -10, 10)                                                       \
    RANGE("Scores of the limbs' proportions; unused ones are 0.",                                                     \
          float, proportion, [GAIT_MAX_PROPORTIONS], "standard deviations", -10, 10)                                  \
    RANGE("Class of motion, index of gait_model_class_name(); not used in standard deviations.",                      \
          int32_t, motion_class, , "", 0, GAIT_MAX_CLASSES - 1)

typedef struct gait_state { GAIT_STATE_FIELDS(GAIT_DECLARE) } gait_state;

/* Skeleton of a state. */
#define GAIT_POSE_FIELDS(FIELD)                                                                                       \
    FIELD("Joints in the world, in the order of gait_model_joint_name().",                                            \
          float, joint, [GAIT_MAX_JOINTS][3], "metres")                                                               \
    FIELD("Joint angles, in the order of gait_model_angle_name().",                                                   \
          float, angle, [GAIT_MAX_ANGLES], "radians")

typedef struct gait_pose { GAIT_POSE_FIELDS(GAIT_DECLARE) } gait_pose;

/* ---- models ------------------------------------------------------------------------------------------ */
/* An immutable view of a blob, which is used in place.  A blob contains a cyclic model (for tracking), a segment prior
 * (for lifting), or both. */
typedef struct gait_model gait_model;

/* Contents of a model. */
#define GAIT_MODEL_INFO_FIELDS(FIELD)                                                                                 \
    FIELD("Reported points of the skeleton.",                                                                         \
          int32_t, joints, , "")                                                                                      \
    FIELD("Joint angles.",                                                                                            \
          int32_t, angles, , "")                                                                                      \
    FIELD("Principal components of the cyclic motion.",                                                               \
          int32_t, components, , "")                                                                                  \
    FIELD("Samples per stride of its curves.",                                                                        \
          int32_t, phases, , "")                                                                                      \
    FIELD("Drawn body parts.",                                                                                        \
          int32_t, limbs, , "")                                                                                       \
    FIELD("Ways in which limbs differ in length at the same stature.",                                                \
          int32_t, proportions, , "")                                                                                 \
    FIELD("Stride rate: mean of the training set.",                                                                   \
          float, stride_hz, , "strides per second")                                                                   \
    FIELD("Stride rate: standard deviation between subjects.",                                                        \
          float, stride_hz_sd, , "strides per second")                                                                \
    FIELD("Stride length: mean of the training set.",                                                                 \
          float, stride_length, , "statures")                                                                         \
    FIELD("Stride length: standard deviation between subjects.",                                                      \
          float, stride_length_sd, , "statures")                                                                      \
    FIELD("1: can track; 0: has only a segment prior, and all fields above are 0.",                                   \
          int32_t, cyclic, , "")                                                                                      \
    FIELD("Bit i: angle i belongs to the trunk or an arm, where posture varies most.",                                \
          uint32_t, posture_angles, , "mask")                                                                         \
    FIELD("Classes of motion.",                                                                                       \
          int32_t, classes, , "")                                                                                     \
    FIELD("Direction of the phase: 1 forwards, -1 backwards, 0 standing.",                                            \
          int32_t, direction, , "")                                                                                   \
    FIELD("Hash of the blob; snapshots carry it.",                                                                    \
          uint64_t, digest, , "")

typedef struct gait_model_info { GAIT_MODEL_INFO_FIELDS(GAIT_DECLARE) } gait_model_info;

/* The blob must be aligned to GAIT_ALIGN and outlive the model. */
GAIT_API gait_result gait_model_bytes(const void *blob, size_t blob_bytes, size_t *bytes, gait_error *err);
GAIT_API gait_result gait_model_init(void *mem, size_t mem_bytes, const void *blob, size_t blob_bytes,
                                     gait_model **out, gait_error *err);
GAIT_API gait_result gait_model_get_info(const gait_model *m, gait_model_info *out, gait_error *err);
GAIT_API const char *gait_model_joint_name(const gait_model *m, int32_t joint); /* NULL: out of range */
GAIT_API const char *gait_model_angle_name(const gait_model *m, int32_t angle); /* NULL: out of range */
GAIT_API const char *gait_model_limb_name(const gait_model *m, int32_t limb);   /* NULL: out of range */
/* Name of a class of motion; "walk" for a blob without names.  NULL: out of range. */
GAIT_API const char *gait_model_class_name(const gait_model *m, int32_t motion_class);
/* The same model with the statistics of one of its classes, for gait_model_get_info(); NULL: out of range. */
GAIT_API const gait_model *gait_model_of_class(const gait_model *m, int32_t motion_class);
/* Mask with bit i set for each angle i among `names`, which are separated by spaces. */
GAIT_API gait_result gait_model_angle_mask(const gait_model *m, const char *names, uint32_t *mask, gait_error *err);
/* Pose of a state: curves (Ormoneit et al. 2000, eq. 3), then forward kinematics. */
GAIT_API gait_result gait_model_pose(const gait_model *m, const gait_state *s, gait_pose *out, gait_error *err);
/* Height of the pelvis above the ground that the model predicts for s, metres; s->pelvis is not read. */
GAIT_API gait_result gait_model_pelvis_height(const gait_model *m, const gait_state *s, float *out, gait_error *err);
/* Draw a state with the model's radii: every pixel of ids (width x height of the camera, ids_stride bytes per row)
 * becomes 0, or 1 + the index of the nearest limb.  The camera is treated as an ideal pinhole. */
GAIT_API gait_result gait_render(const gait_model *m, const gait_camera *cam, const gait_state *s, uint8_t *ids,
                                 int32_t ids_stride, gait_error *err);

/* ---- tracker (Ormoneit et al. 2000) ------------------------------------------------------------------ */
typedef struct gait_tracker gait_tracker;
/* Two sets of defaults: the library's, and the likelihood and dynamics of the paper. */
typedef GAIT_ENUM(gait_mode) { GAIT_MODE_DEFAULT = 0, GAIT_MODE_PAPER = 1 } gait_mode;

/* Terms of the likelihood. */
#define GAIT_TERM_TEXTURE    0x1u  /* texture of the previous frame, moved by each particle, eqs. 10-13 */
#define GAIT_TERM_SILHOUETTE 0x2u  /* foreground outside and background inside the body; needs a background */
#define GAIT_TERM_EDGES      0x4u  /* image gradient along the limbs' outlines */
#define GAIT_TERM_TEMPLATE   0x8u  /* running appearance of each limb */
#define GAIT_TERM_KEYPOINTS  0x10u /* joints that a detector found in the images, gait_frame keypoints */
#define GAIT_TERMS_DEFAULT (GAIT_TERM_TEXTURE | GAIT_TERM_SILHOUETTE | GAIT_TERM_EDGES | GAIT_TERM_TEMPLATE)

/* Source of threads: run() calls fn(ctx, i) exactly once for each i in [0, count), in any order, on any threads, and
 * returns when all calls have returned.  run NULL: the calling thread does the work. */
typedef void gait_task_fn(void *ctx, int32_t task);
typedef void gait_run_fn(void *user, gait_task_fn *fn, void *ctx, int32_t count);
#define GAIT_TASKS_FIELDS(FIELD)                                                                                      \
    FIELD("Runs the tasks; NULL: the calling thread does.",                                                           \
          gait_run_fn *, run, , "")                                                                                   \
    FIELD("First argument of run().",                                                                                 \
          void *, user, , "")

typedef struct gait_tasks { GAIT_TASKS_FIELDS(GAIT_DECLARE) } gait_tasks;

/* Settings of a tracker.  gait_tracker_default() fills them; change what you need. */
#define GAIT_TRACKER_CONFIG_FIELDS(SETTING, PAPER, FIELD)                                                             \
    FIELD("Size of this struct in the caller's header, set by gait_tracker_default().",                               \
          uint64_t, struct_size, , "bytes")                                                                           \
    FIELD("Set of defaults, set by gait_tracker_default().",                                                          \
          gait_mode, mode, , "")                                                                                      \
    PAPER("Number of particles.  Time is proportional to it.",                                                        \
          int32_t, particles, , "", 2000, 10000, 16, 1 << 20)                                                         \
    SETTING("Seed of the random numbers.",                                                                            \
          uint64_t, seed, , "", 1, NAN, NAN)                                                                          \
    SETTING("Cameras that see the person.",                                                                           \
          int32_t, cameras, , "", 1, 1, GAIT_MAX_CAMERAS)                                                             \
    SETTING("Parts of a step that can run in parallel, one per thread of exec; each takes 0.1 MB if exec is set.",    \
          int32_t, tasks, , "", 8, 1, 256)                                                                            \
    SETTING("Frames that gait_tracker_lagged() can go back; 0: none.",                                                \
          int32_t, lag, , "frames", 0, 0, 64)                                                                         \
    PAPER("Likelihood terms in use, a set of GAIT_TERM_*.",                                                           \
          uint32_t, terms, , "mask", GAIT_TERMS_DEFAULT, GAIT_TERM_TEXTURE, NAN, NAN)                                 \
    FIELD("The cameras; the first `cameras` are used.",                                                               \
          gait_camera, camera, [GAIT_MAX_CAMERAS], "")                                                                \
    FIELD("Source of threads; results do not depend on it.",                                                          \
          gait_tasks, exec, , "")                                                                                     \
    SETTING("Limb radii as a multiple of the model's; clothes widen them.",                                           \
          float, girth, , "", 1, 0.5, 2)                                                                              \
    SETTING("Longest accepted interval between two frames.",                                                          \
          float, max_dt, , "seconds", 0.5, 1e-3, 10)                                                                  \
    /* ---- advanced settings: parts of the model that vary ---- */                                                   \
    PAPER("Angles whose posture varies; bit i: angle i; -1: gait_model_info posture_angles.",                         \
          int64_t, offset_angles, , "mask", -1, 0, -1, UINT32_MAX)                                                    \
    PAPER("During acquisition, until left and right are known, particles are doubled up to this number.",             \
          int32_t, acquisition_particles, , "", 4000, 0, 0, 1 << 20)                                                  \
    SETTING("Principal components in use; -1: the first 5, all in paper mode.",                                       \
          int32_t, components, , "", -1, -1, GAIT_MAX_COMPONENTS)                                                     \
    SETTING("Limb proportions that vary; -1: all of the model.",                                                      \
          int32_t, proportions, , "", 0, -1, GAIT_MAX_PROPORTIONS)                                                    \
    SETTING("Instruction sets that may be used, GAIT_CPU_*; 0: scalar code.  Results do not depend on it.",           \
          uint32_t, cpu_mask, , "mask", ~0u, NAN, NAN)                                                                \
    /* ---- advanced settings: likelihood and resampling ---- */                                                      \
    PAPER("Weight of the texture term.",                                                                              \
          float, texture_weight, , "nats per unit cost", 0.2, 1, 0, 1e6)                                              \
    SETTING("Weight of the silhouette term.",                                                                         \
          float, silhouette_weight, , "nats per unit cost", 25, 0, 1e6)                                               \
    SETTING("Weight of the edge term; also decides with what evidence a person is lost.",                             \
          float, edges_weight, , "nats per unit cost", 40, 0, 1e6)                                                    \
    SETTING("Weight of the template term.",                                                                           \
          float, template_weight, , "nats per unit cost", 4, 0, 1e6)                                                  \
    SETTING("Weight of the keypoint term.",                                                                           \
          float, keypoints_weight, , "nats per unit cost", 8, 0, 1e6)                                                 \
    SETTING("Cost of foreground outside the body, relative to background inside it.",                                 \
          float, missed_weight, , "", 0.6, 0, 1)                                                                      \
    PAPER("Resample when the effective sample size is below this fraction of the particles.",                         \
          float, resample_ess, , "", 0.5, 1, 0, 1)                                                                    \
    PAPER("Time for which errors of the image terms persist; closer frames count less; 0: all count in full.",        \
          float, evidence_time, , "seconds", 0.1, 0, 0, 1e6)                                                          \
    PAPER("Time constant after which particles no longer depend on one ancestor; 0: no rejuvenation.",                \
          float, rejuvenation_time, , "seconds", 0.15, 0, 0, 1e6)                                                     \
    PAPER("Model error, added in quadrature to the reported joint_sd.",                                               \
          float, joint_sd_model, , "statures", 0.015, 0, 0, 1)                                                        \
    /* ---- advanced settings: dynamics (eqs. 5-9): standard deviations of random walks, time constants ---- */       \
    PAPER("Random walk of the phase.",                                                                                \
          float, phase_noise, , "strides per sqrt(second)", 0.0164, 0.002, 0, 10)                                     \
    PAPER("Random walk of the stride rate, as a fraction of the model's mean rate.",                                  \
          float, rate_noise, , "1 per sqrt(second)", 0.055, 0.03, 0, 10)                                              \
    SETTING("Time in which stature and rate settle once phase, left and right are known.",                            \
          float, settle_time, , "seconds", 1, 0, 1e6)                                                                 \
    PAPER("Time constant of the stride rate's return to the mean, ten times longer with several classes; 0: never.",  \
          float, rate_time, , "seconds", 3, 0, 0, 1e6)                                                                \
    PAPER("Random walk of the pelvis along the heading.",                                                             \
          float, forward_noise, , "metres per sqrt(second)", 0.08, 0.06, 0, 100)                                      \
    PAPER("Random walk of the pelvis across the heading.",                                                            \
          float, lateral_noise, , "metres per sqrt(second)", 0.02, 0.0096, 0, 100)                                    \
    PAPER("Random walk of the height of the pelvis.",                                                                 \
          float, vertical_noise, , "metres per sqrt(second)", 0.0096, 0.015, 0, 100)                                  \
    PAPER("Random walk of the heading.",                                                                              \
          float, heading_noise, , "radians per sqrt(second)", 0.044, 0.021, 0, 100)                                   \
    PAPER("Standard deviation of turn rates.",                                                                        \
          float, turn_sd, , "radians per second", 0.5, 0, 0, 100)                                                     \
    PAPER("Mean time until the turn rate changes, half of the time to 0; 0: always straight on.",                     \
          float, turn_time, , "seconds", 6, 0, 0, 1e6)                                                                \
    PAPER("Random walk of pitch and roll.",                                                                           \
          float, tilt_noise, , "radians per sqrt(second)", 0.033, 0.01, 0, 100)                                       \
    PAPER("Time constant with which pitch, roll and height return to the model's; 0: never.",                         \
          float, tilt_time, , "seconds", 1.1, 0, 0, 1e6)                                                              \
    PAPER("Random walk of the principal-component scores.",                                                           \
          float, coef_noise, , "standard deviations per sqrt(second)", 0.667, 0.028, 0, 100)                          \
    PAPER("Time constant with which the scores return to the mean; 0: never.",                                        \
          float, coef_time, , "seconds", 4.5, 0, 0, 1e6)                                                              \
    PAPER("Random walk of the stature, in standard deviations of the start.",                                         \
          float, stature_noise, , "standard deviations per sqrt(second)", 0.2, 0, 0, 100)                             \
    PAPER("Random walk of the stature while it settles, in standard deviations of the start.",                        \
          float, stature_noise_start, , "standard deviations per sqrt(second)", 2, 0, 0, 100)                         \
    SETTING("Random walk of the posture offsets, which return to the spread among people.",                           \
          float, offset_noise, , "standard deviations per sqrt(second)", 0.58, 0, 100)                                \
    SETTING("Random walk of the proportions' scores, which return to a standard deviation of 1.",                     \
          float, proportion_noise, , "standard deviations per sqrt(second)", 0.15, 0, 100)                            \
    SETTING("Share of each stride that a belt cancels: 0 on the floor, 1 on a treadmill.",                            \
          double, belt, , "", 0, 0, 1)                                                                                \
    SETTING("1: frames come in reverse order, as from a file; utime still increases from frame to frame.",            \
          double, reverse, , "", 0, 0, 1)                                                                             \
    /* ---- paper mode: parameters that eqs. 10-12 do not specify ---- */                                             \
    SETTING("Paper mode: density of the image of a hidden limb, p_occluded of eq. 12.",                               \
          float, occluded_density, , "1 per grey level", 0.01, 0x1p-20, 1)                                            \
    SETTING("Paper mode: change of a limb's surface from frame to frame (eq. 11).",                                   \
          float, surface_sd, , "grey levels", 14, 0, 255)                                                             \
    SETTING("Paper mode: growth of the variance of surface_sd with the squared tangent of the angle to the image.",   \
          float, surface_tilt, , "", 0.99, 0, 1e3)                                                                    \
    SETTING("Paper mode: surface points compared on a limb that faces the camera, n_s of eq. 10.",                    \
          int32_t, limb_points, , "", 16, 2, 16)                                                                      \
    SETTING("Paper mode: lost if the image under the body more likely stayed than moved, by so much; 0: never.",      \
          float, stayed_nats, , "nats", 2.5, 0, 1e6)                                                                  \
    PAPER("Factor on the standard deviation of the scores when a start draws them.",                                  \
          float, coef_start, , "", 1, 0.3, 0, 1)

typedef struct gait_tracker_config {
    GAIT_TRACKER_CONFIG_FIELDS(GAIT_DECLARE, GAIT_DECLARE, GAIT_DECLARE)
} gait_tracker_config;

/* A joint located in an image. */
#define GAIT_KEYPOINT_FIELDS(FIELD)                                                                                   \
    FIELD("Column in the image as captured (distorted).",                                                             \
          float, u, , "pixels")                                                                                       \
    FIELD("Row in the image as captured (distorted).",                                                                \
          float, v, , "pixels")                                                                                       \
    FIELD("Standard deviation, including that between the detector's joint and the model's; <= 0: unobserved.",       \
          float, sd, , "pixels")

typedef struct gait_keypoint { GAIT_KEYPOINT_FIELDS(GAIT_DECLARE) } gait_keypoint;

/* Pose of a camera in one frame. */
#define GAIT_CAMERA_POSE_FIELDS(RANGE)                                                                                \
    RANGE("Rotation from world to camera, row-major.",                                                                \
          float, R, [9], "", -2, 2)                                                                                   \
    RANGE("World origin in camera coordinates.",                                                                      \
          float, t, [3], "metres", -1e4, 1e4)                                                                         \
    RANGE("Standard deviation of the rotation about each axis; 0: exact.",                                            \
          float, turn_sd, , "radians", 0, 1)                                                                          \
    RANGE("Standard deviation of each coordinate of its position; 0: exact.",                                         \
          float, place_sd, , "metres", 0, 10)

typedef struct gait_camera_pose { GAIT_CAMERA_POSE_FIELDS(GAIT_DECLARE) } gait_camera_pose;

/* Observations at one time.  A field of 0 is not given.
 *
 * Of several people, each with a tracker, one may hide another: where the nearest person in `people` is another than
 * `person`, the silhouette is not compared.  The tracked person then counts as hidden there, not as absent, and the
 * other's foreground as explained.  These pictures are the same for all trackers: draw each person with
 * gait_render(), the farthest first. */
#define GAIT_FRAME_FIELDS(FIELD)                                                                                      \
    FIELD("Size of this struct in the caller's header; 0: this one.",                                                 \
          uint64_t, struct_size, , "bytes")                                                                           \
    FIELD("Capture time; must increase.",                                                                             \
          int64_t, utime, , "microseconds")                                                                           \
    FIELD("Image of each camera; data NULL: that camera missed this frame.",                                          \
          gait_image, image, [GAIT_MAX_CAMERAS], "")                                                                  \
    FIELD("The model's joints in order, for GAIT_TERM_KEYPOINTS; NULL: none.  Used if the camera has an image.",      \
          const gait_keypoint *, keypoints, [GAIT_MAX_CAMERAS], "")                                                   \
    FIELD("Pose of each camera in this frame; NULL: the config's.  The state stays in world coordinates.",            \
          const gait_camera_pose *, pose, [GAIT_MAX_CAMERAS], "")                                                     \
    FIELD("Empty scene seen by each camera in this frame; data NULL: that of gait_tracker_set_background().",         \
          gait_image, background, [GAIT_MAX_CAMERAS], "")                                                             \
    FIELD("Number of the nearest person in each undistorted pixel, or 0 (GREY8).",                                    \
          gait_image, people, [GAIT_MAX_CAMERAS], "")                                                                 \
    FIELD("That of the tracked one.",                                                                                 \
          uint64_t, person, , "")

typedef struct gait_frame { GAIT_FRAME_FIELDS(GAIT_DECLARE) } gait_frame;

/* INIT: the track is settling.  AMBIGUOUS: left and right are unknown, two hypotheses fit about equally, or another body
 * fits as well (GAIT_EST_OTHERS_FIT).  LOST: the images no longer support the estimate. */
typedef GAIT_ENUM(gait_track_status) {
    GAIT_TRACK_INIT = 0, GAIT_TRACK_TRACKING = 1, GAIT_TRACK_AMBIGUOUS = 2, GAIT_TRACK_LOST = 3
} gait_track_status;

#define GAIT_EST_RESAMPLED  0x1u
#define GAIT_EST_NO_IMAGE   0x2u /* prediction only */
#define GAIT_EST_DEGENERATE 0x4u /* effective sample size below 2 */
#define GAIT_EST_UNSUPPORTED 0x8u /* the images do not show a person at the estimate */
#define GAIT_EST_OTHERS_FIT  0x10u /* over the last frames a different body fits as well: turned, or in another phase */

/* Estimate after a frame. */
#define GAIT_ESTIMATE_FIELDS(FIELD)                                                                                   \
    FIELD("Capture time.",                                                                                            \
          int64_t, utime, , "microseconds")                                                                           \
    FIELD("Steps since the start.",                                                                                   \
          uint64_t, frame, , "")                                                                                      \
    FIELD("log p(frame | past), weighted by config evidence_time, up to a constant.",                                 \
          double, log_evidence, , "nats")                                                                             \
    FIELD("Mean of the dominant hypothesis; circular in phase and heading.",                                          \
          gait_state, mean, , "")                                                                                     \
    FIELD("Standard deviation of each number over all particles; circular in phase and heading.",                     \
          gait_state, sd, , "")                                                                                       \
    FIELD("Particle with the largest weight.",                                                                        \
          gait_state, best, , "")                                                                                     \
    FIELD("Joints: posterior mean (paper mode: without root motion).  Angles: dominant hypothesis.",                  \
          gait_pose, pose, , "")                                                                                      \
    FIELD("Standard deviation of the joints, with joint_sd_model and, for a single camera, uncertainty of size.",     \
          float, joint_sd, [GAIT_MAX_JOINTS][3], "metres")                                                            \
    FIELD("Effective sample size after weighting.",                                                                   \
          float, ess, , "particles")                                                                                  \
    FIELD("Resultant length of the phase in [0, 1]; 1: certain.",                                                     \
          float, phase_r, , "")                                                                                       \
    FIELD("Weight of the dominant hypothesis in [0, 1].",                                                             \
          float, hypothesis_weight, , "")                                                                             \
    FIELD("Speed along the ground; 0 if the class stands, when phase and stride rate have no meaning.",               \
          float, speed, , "metres per second")                                                                        \
    FIELD("State of the track.",                                                                                      \
          gait_track_status, status, , "")                                                                            \
    FIELD("Events of this step, GAIT_EST_*.",                                                                         \
          uint32_t, flags, , "mask")                                                                                  \
    FIELD("Most probable class of motion, the mean's.",                                                               \
          int32_t, motion_class, , "")                                                                                \
    FIELD("Probability of each class of motion; unused ones are 0.",                                                  \
          float, class_probability, [GAIT_MAX_CLASSES], "")

typedef struct gait_estimate { GAIT_ESTIMATE_FIELDS(GAIT_DECLARE) } gait_estimate;

/* Fill the first cfg_bytes of a config with the defaults; called by gait_tracker_default(), which knows the size. */
GAIT_API void gait_tracker_fill(gait_tracker_config *cfg, size_t cfg_bytes, gait_mode mode);
static inline void gait_tracker_default(gait_tracker_config *cfg, gait_mode mode)
{
    gait_tracker_fill(cfg, sizeof *cfg, mode);
}

/* A config from an older, shorter gait.h is accepted; the fields that it lacks get their defaults. */
GAIT_API gait_result gait_tracker_bytes(const gait_model *m, const gait_tracker_config *cfg, size_t *bytes,
                                        gait_error *err);
GAIT_API gait_result gait_tracker_init(void *mem, size_t mem_bytes, const gait_model *m,
                                       const gait_tracker_config *cfg, gait_tracker **out, gait_error *err);
/* Empty scene of one camera as captured (distorted), at the pose in the config; it is not used for frames with another
 * pose.  Its pixels are borrowed until it is replaced or the tracker is no longer used.  plate NULL: none; the
 * silhouette term then has no effect.  Snapshots do not contain it. */
GAIT_API gait_result gait_tracker_set_background(gait_tracker *t, int32_t camera, const gait_image *plate,
                                                 gait_error *err);
/* Broad prior: uniform phase, average stride rate and stature, unknown heading, pelvis at the origin, a turn rate with an sd
 * of 0.25 rad/s. */
GAIT_API gait_result gait_tracker_prior(const gait_model *m, gait_state *mean, gait_state *sd, gait_error *err);
/* Draw the particles from independent normals; a phase or heading with an sd of half a turn or more is uniform, and half of
 * the particles have the mean turn rate, the others one with 1.41 times the sd.  Means must be in the ranges of gait_state,
 * standard deviations in [0, 10]. */
GAIT_API gait_result gait_tracker_start(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime,
                                        gait_error *err);
/* One frame: resample, rejuvenate, predict, weight, estimate.  A first frame at the start's time is not predicted. */
GAIT_API gait_result gait_tracker_step(gait_tracker *t, const gait_frame *frame, gait_estimate *out, gait_error *err);
/* Estimate of the frame `back` steps ago, in [0, config lag], given every frame since: its particles have the present
 * weights of their descendants.  0: the present frame.  GAIT_ERR_STATE: fewer steps since the start.  ess counts the
 * remaining ancestors.  With `back` 0 the status is that of the step; a status of LOST stays, others depend on what is known
 * now, and are AMBIGUOUS where a frame up to 0.7 s later has GAIT_EST_OTHERS_FIT. */
GAIT_API gait_result gait_tracker_lagged(gait_tracker *t, int32_t back, gait_estimate *out, gait_error *err);

/* ---- advanced: instruction sets ---------------------------------------------------------------------- */
/* The tracker uses the best set that both the CPU and config cpu_mask have. */
#define GAIT_CPU_BASE   0x1u /* of every CPU of the architecture: SSE2, NEON */
#define GAIT_CPU_AVX2   0x2u /* and POPCNT, BMI2 */
#define GAIT_CPU_AVX512 0x4u /* F, BW, DQ, VL, VBMI, VPOPCNTDQ, BITALG */
#define GAIT_CPU_SSE4   0x8u /* x86-64-v2: SSSE3, SSE4.1, POPCNT */
GAIT_API uint32_t    gait_cpu_features(void);      /* GAIT_CPU_* of this CPU and build */
GAIT_API const char *gait_cpu_name(uint32_t mask); /* what cpu_mask gives here: "scalar", "base", "sse4", "avx2" or "avx512" */

/* ---- advanced: particles, snapshots, replay ---------------------------------------------------------- */
/* Continue with another number of particles in [16, config particles], drawn by weight in the next step.  The change
 * waits while there are two left/right hypotheses.  A start keeps it. */
GAIT_API gait_result gait_tracker_set_particles(gait_tracker *t, int32_t particles, gait_error *err);
/* Copy up to cap particles with normalised weights; returns how many there are, or a negative gait_result. */
GAIT_API int32_t     gait_tracker_particles(const gait_tracker *t, gait_state *s, float *weight, int32_t cap,
                                            gait_error *err);
/* Predict n states by dt seconds, in [0, config max_dt], with the present dynamics and separate random numbers, without
 * an image.  The same call between the same steps gives the same result. */
GAIT_API gait_result gait_tracker_predict(const gait_tracker *t, gait_state *s, int32_t n, double dt, gait_error *err);
/* Hash of the whole state: the same after the same input, on any machine. */
GAIT_API uint64_t    gait_tracker_digest(const gait_tracker *t);
/* Copy the whole state to mem, of cap bytes; mem NULL: only return its size. */
GAIT_API gait_result gait_tracker_save(const gait_tracker *t, void *mem, size_t cap, size_t *bytes, gait_error *err);
/* Restore a state saved by a tracker with the same model and configuration; a failure leaves the tracker unchanged. */
GAIT_API gait_result gait_tracker_restore(gait_tracker *t, const void *mem, size_t bytes, gait_error *err);

/* ---- advanced: description of the structs ------------------------------------------------------------ */
/* A row of the tables above.  Defaults are those that gait_tracker_default() and gait_lift_default() fill in. */
typedef struct gait_field {
    const char *of;            /* struct, "gait_state" */
    const char *name;          /* field; "": the struct itself */
    const char *type, *array;  /* "float", "[32][3]"; array "": a single value */
    const char *unit, *text;   /* "metres"; the meaning */
    uint32_t    offset, size;  /* bytes */
    double      low, high;     /* range; NAN: none is checked */
} gait_field;

/* Row `index` of all structs, each struct's own row before its fields.  GAIT_ERR_ARG: past the last one. */
GAIT_API gait_result gait_field_at(uint32_t index, gait_field *out);

#ifdef __cplusplus
}
#endif
#endif
