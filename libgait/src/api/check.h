/* check.h - argument checks that several public functions share. */
#ifndef GAIT_API_CHECK_H
#define GAIT_API_CHECK_H
#include "base/base.h"

/* What is required of a camera: the text of every error about one that is not. */
#define CHECK_CAMERA                                                                                         \
    "size must be positive, fx, fy in [1e-3, 1e9], cx, cy in [-1e6, 1e6], R a rotation, t in [-1e4, 1e4] "   \
    "metres, distortion in [-1e3, 1e3]"

/* Whether a camera can be used; `index` is its number in errors, -1: the only one. */
gait_result check_camera(const gait_camera *c, int32_t index, gait_error *err);

/* Whether a camera's pose in a frame can be used; `out`, which may be the camera itself, receives the camera there. */
gait_result check_camera_pose(const gait_camera *c, int32_t index, const gait_camera_pose *pose,
                              gait_camera *out, gait_error *err);

/* Whether an image fits the camera of this number; `what` is its name in errors. */
gait_result check_image(const gait_camera *cam, int32_t camera, const gait_image *im, const char *what,
                        gait_error *err);

/* Report why a function of a state failed with result s. */
gait_result check_pose(gait_result s, const char *function, gait_error *err);
#endif
