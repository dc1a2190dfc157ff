/* camera_file.h - the project's camera JSON; other formats reach the daemon through `gait capture`. */
#ifndef TRACKD_CAMERA_FILE_H
#define TRACKD_CAMERA_FILE_H
#include "gait.h"
#include "message.h"

enum { CAMERA_PIXELS = 16000 }; /* each way, at the most: what the library takes */

bool camera_file_read(const char *path, gait_camera *out, message *why);
/* The rows of R must be orthogonal, of length 1 and right-handed, to three digits. */
bool camera_rotation_ok(const gait_camera *camera);
#endif
