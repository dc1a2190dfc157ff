/* cameras.h - cameras from files and messages; every fault is one line in `why`. */
#ifndef TRACKD_CAMERAS_H
#define TRACKD_CAMERAS_H
#include "gait.h"
#include "gaitmsg_camera_t.h"
#include "common.h"

/* The project's camera JSON; files of other formats reach the daemon through `gait capture`. */
bool camera_file_read(const char *path, gait_camera *out, message *why);
/* A camera that was announced over LCM. */
bool camera_from_message(const gaitmsg_camera_t *in, int32_t max_pixels, gait_camera *out, message *why);
/* Whether a camera that was sent or saved can be used; not if width times height is more than `max_pixels`. */
bool camera_check(const gait_camera *camera, int32_t max_pixels, message *why);
/* Whether the pose of a valid camera is plausible, by gait_camera_check().  `name`: its file or channel, for the error. */
bool camera_plausible(const gait_camera *camera, const char *name, message *why);
/* Equal up to rounding, which differs between files and messages, and readers may orthogonalise R. */
bool camera_same(const gait_camera *a, const gait_camera *b);
#endif
