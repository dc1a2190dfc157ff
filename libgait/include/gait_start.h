/* gait_start.h - the automatic start: where a person is and how they walk, from a second of observations.
 *
 * A walk is fitted to one person's 2-D keypoints, or to boxes around people, from a detector or from
 * gait_start_find_boxes(), which compares images with the empty scene.  The camera is static, or its pose is given
 * with gait_start_set_pose(); a person walks straight at constant speed, or stays in place.  With keypoints every
 * direction, phase and side is tried; boxes give position, direction and stature, but not the phase.  The results are
 * a few weighted hypotheses for gait_tracker_start_hypotheses().  Conventions, units, memory and errors are those of
 * gait.h. */
#ifndef GAIT_START_H
#define GAIT_START_H
#include "gait.h"
#ifdef __cplusplus
extern "C" {
#endif

#define GAIT_START_MAX_FRAMES 64    /* frames of keypoints, and of boxes, that are stored; the oldest are dropped */
#define GAIT_START_MAX_PEOPLE 4     /* people followed at a time, by boxes */
#define GAIT_START_MAX_HYPOTHESES 8 /* that gait_start_solve() returns, at most */

typedef struct gait_start gait_start;

/* Settings of a start.  gait_start_default() fills them; set the camera, and change what you need. */
#define GAIT_START_CONFIG_FIELDS(SETTING, FIELD)                                                                      \
    FIELD("Size of this struct in the caller's header, set by gait_start_default().",                                 \
          uint32_t, struct_size, , "bytes")                                                                           \
    SETTING("Instruction sets that may be used, GAIT_CPU_*; 0: scalar code.  Results do not depend on it.",           \
          uint32_t, cpu_mask, , "mask", ~0u, NAN, NAN)                                                                \
    SETTING("Stature of the person; 0: the mean of the model's adults.",                                              \
          float, stature, , "metres", 0, 0, 2.5)                                                                      \
    SETTING("Its standard deviation; 0: that of the model's adults.",                                                 \
          float, stature_sd, , "metres", 0, 0, 1)                                                                     \
    SETTING("Standard deviation of the difference between the model's joints and the detector's, fraction of the"     \
            " person's height in the image.",                                                                         \
          float, joint_sd, , "", 0.025f, 0.001, 1)                                                                    \
    SETTING("Correlation time of a detector's errors: closer frames count as one.",                                   \
          float, error_time, , "seconds", 0.25f, 0, 10)                                                               \
    SETTING("Time that the boxes of a person must cover.",                                                            \
          float, box_time, , "seconds", 1, 0.3, 1.4)                                                                  \
    FIELD("Calibrated camera; the floor is the plane z = 0.",                                                         \
          gait_camera, camera, , "")

typedef struct gait_start_config { GAIT_START_CONFIG_FIELDS(GAIT_DECLARE, GAIT_DECLARE) } gait_start_config;

/* A person who stands on the floor in full view. */
#define GAIT_BOX_FIELDS(FIELD)                                                                                        \
    FIELD("Lowest point of the feet, at the middle of the body, in the image as captured.",                           \
          float, foot, [2], "pixels")                                                                                 \
    FIELD("Crown of the head.",                                                                                       \
          float, head, [2], "pixels")                                                                                 \
    FIELD("Standard deviation of these coordinates.",                                                                 \
          float, sd, , "pixels")

typedef struct gait_box { GAIT_BOX_FIELDS(GAIT_DECLARE) } gait_box;

/* One result: normal distributions about a mean. */
#define GAIT_HYPOTHESIS_FIELDS(FIELD)                                                                                 \
    FIELD("State at the requested time; fields that are not fitted are 0.",                                           \
          gait_state, mean, , "")                                                                                     \
    FIELD("Its standard deviations; the model's prior for fields that are not fitted.",                               \
          gait_state, sd, , "")                                                                                       \
    FIELD("Correlation of phase, stride_hz, stature, heading, pelvis x and y; all 0: independent.",                  \
          float, correlation, [6][6], "")                                                                             \
    FIELD("Speed in the direction of the class of motion: against the heading if it is backwards.",                   \
          float, speed, , "metres per second")                                                                        \
    FIELD("Its standard deviation.",                                                                                  \
          float, speed_sd, , "metres per second")                                                                     \
    FIELD("Probability among the hypotheses found, in [0, 1].",                                                       \
          float, probability, , "")                                                                                   \
    FIELD("Robust chi-square per coordinate: about 1 if the model fits.",                                             \
          float, chi2_per_observation, , "")                                                                          \
    FIELD("1: the person walks in place, as on a treadmill.",                                                         \
          int32_t, in_place, , "")                                                                                    \
    FIELD("Coordinates fitted.",                                                                                      \
          int32_t, observations, , "")

typedef struct gait_hypothesis { GAIT_HYPOTHESIS_FIELDS(GAIT_DECLARE) } gait_hypothesis;

/* Fill the first cfg_bytes of a config with the defaults; called by gait_start_default(), which knows the size. */
GAIT_API void gait_start_fill(gait_start_config *cfg, size_t cfg_bytes);
static inline void gait_start_default(gait_start_config *cfg)
{
    gait_start_fill(cfg, sizeof *cfg);
}
/* The model must outlive the start.  GAIT_ERR_ARG: it has no cyclic part, or no joints l_hip r_hip l_ankle r_ankle
 * head_top. */
GAIT_API gait_result gait_start_bytes(const gait_model *m, const gait_start_config *cfg, size_t *bytes, gait_error *err);
GAIT_API gait_result gait_start_init(void *mem, size_t mem_bytes, const gait_model *m, const gait_start_config *cfg,
                                     gait_start **out, gait_error *err);
/* Pose of the camera for the frames and boxes from now on, instead of the config's; its standard deviations are not
 * used. */
GAIT_API gait_result gait_start_set_pose(gait_start *s, const gait_camera_pose *pose, gait_error *err);
/* One frame: the model's joints in order, as in gait_frame; utime must increase. */
GAIT_API gait_result gait_start_add(gait_start *s, int64_t utime, const gait_keypoint *keypoints, gait_error *err);
/* One frame: boxes around people, the most certain first; utime must increase.  Boxes of people shorter than 1.2 m or
 * taller than 2.4 m are ignored; the others are matched by position to the people of earlier frames. */
GAIT_API gait_result gait_start_add_boxes(gait_start *s, int64_t utime, const gait_box *boxes, int32_t count,
                                          gait_error *err);
/* Person-sized regions in which a frame differs from the empty scene, the largest first, at most `capacity`; both
 * images must have the camera's size.  Regions that touch the border are ignored. */
GAIT_API gait_result gait_start_find_boxes(gait_start *s, const gait_image *frame, const gait_image *background,
                                           gait_box *out, int32_t capacity, int32_t *count, gait_error *err);
/* 1 if half of the frame differs from the background: it shows another scene, or the camera has moved. */
GAIT_API gait_result gait_start_other_scene(gait_start *s, const gait_image *frame, const gait_image *background,
                                            int32_t *other, gait_error *err);
/* Stature of the person in a box, metres, if they stand where the ray of the foot meets the floor; NAN if it does not:
 * the camera is impossible, or the box is above the horizon. */
GAIT_API gait_result gait_start_box_stature(const gait_start *s, const gait_box *box, float *stature, gait_error *err);
/* Forget the frames. */
GAIT_API void        gait_start_reset(gait_start *s);
/* Fit the keypoints or, if there are too few, the boxes of each person, and return at most `capacity` hypotheses for
 * the moment `utime`, the most probable first.  Those of keypoints are of any class of motion that takes strides, those
 * of boxes of the first.
 * GAIT_ERR_STATE: too few frames; it takes four with hips and ankles over 0.3 s, or eight with a box of the same
 * person over config box_time.  GAIT_ERR_NUMERIC: nothing fits. */
GAIT_API gait_result gait_start_solve(gait_start *s, int64_t utime, gait_hypothesis *out, int32_t capacity,
                                      int32_t *count, gait_error *err);
/* Start a tracker from the hypotheses of gait_start_solve(), the most probable first: each gives particles in
 * proportion to its probability.  The images of the next frames decide between them, and whether a person is there at
 * all; until then the status is GAIT_TRACK_INIT.  Hypotheses are ignored if they are a hundred times less probable
 * than the first, elsewhere in the image, or differ from it in `in_place`.  Ranges as for gait_tracker_start(); count
 * must be in [1, GAIT_START_MAX_HYPOTHESES]. */
GAIT_API gait_result gait_tracker_start_hypotheses(gait_tracker *t, const gait_hypothesis *hypotheses, int32_t count,
                                                   int64_t utime, gait_error *err);
/* 1: a walk that fits the observations well enough for a start.  0: the person may be standing, the direction may be
 * unknown, or the observations may show something else. */
GAIT_API int32_t     gait_hypothesis_walks(const gait_hypothesis *h);

#ifdef __cplusplus
}
#endif
#endif
