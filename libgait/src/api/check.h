/* check.h - argument checks that several public functions share. */
#ifndef GAIT_API_CHECK_H
#define GAIT_API_CHECK_H
#include "base/base.h"

/* A camera that can be projected with; `index` is its number in errors, -1: the only one. */
gait_result check_camera(const gait_camera *c, int32_t index, gait_error *err);

/* Where a camera is in a frame; `out`, which may be the camera itself, becomes the camera there. */
gait_result check_camera_pose(const gait_camera *c, int32_t index, const gait_camera_pose *pose,
                              gait_camera *out, gait_error *err);

/* Pixels as the camera of this number gives them; `what` is their name in errors. */
gait_result check_image(const gait_camera *cam, int32_t camera, const gait_image *im, const char *what,
                        gait_error *err);

/* Explain why a function of a state failed with s. */
gait_result check_pose(gait_result s, const char *function, gait_error *err);
#endif
