/* input_files.h - files that the command line names: camera, start and picture of the empty scene. */
#ifndef TRACKD_INPUT_FILES_H
#define TRACKD_INPUT_FILES_H
#include "common.h"
#include "gait.h"

/* ---- binary PGM (P5) and PPM (P6) pictures of 8 bits. */
/* `out` points into `bytes`, which the caller frees. */
bool pnm_read(const char *path, file_bytes *bytes, gait_image *out, message *why);

/* ---- the project's camera JSON; other formats reach the daemon through `gait capture`. */
enum { CAMERA_PIXELS = 16000 }; /* each way, at the most: what the library takes */

bool camera_file_read(const char *path, gait_camera *out, message *why);
/* The rows of R must be orthogonal, of length 1 and right-handed, to three digits. */
bool camera_rotation_ok(const gait_camera *camera);

/* ---- where the walker is at one frame, by the project's init JSON; same rules as gait/core/initial.py. */
typedef struct init_state {
    int64_t frame; /* number of the frame at which it holds; -1: the first that comes */
    gait_state mean, sd;
} init_state;

/* What the file does not say comes from the model's prior, the height of the pelvis from the model itself. */
bool init_file_read(const char *path, const gait_model *model, init_state *out, message *why);
#endif
