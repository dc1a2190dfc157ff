/* input_files.h - files that the command line names: camera, start and background. */
#ifndef TRACKD_INPUT_FILES_H
#define TRACKD_INPUT_FILES_H
#include "common.h"
#include "gait.h"

/* ---- binary PGM (P5) and PPM (P6) images of 8 bits. */
/* `out` points into `bytes`, which the caller frees. */
bool pnm_read(const char *path, file_bytes *bytes, gait_image *out, message *why);

/* ---- the project's camera JSON; other formats reach the daemon through `gait capture`. */
bool camera_file_read(const char *path, gait_camera *out, message *why);
/* The rows of R must be orthogonal and of length 1 to 1e-3, as in the library, and right-handed. */
bool camera_rotation_ok(const gait_camera *camera);

/* ---- where the person is at one frame, by the project's init JSON; same rules as python/gait/bindings/initial.py. */
typedef struct init_state {
    int64_t frame; /* number of the frame; -1: the first one */
    gait_state mean, sd;
} init_state;

/* Keys that the file lacks are taken from the model's prior, the height of the pelvis from its kinematics. */
bool init_file_read(const char *path, const gait_model *model, init_state *out, message *why);
#endif
