/* input_files.h - files that the command line names: start and background; the camera is in cameras.h. */
#ifndef TRACKD_INPUT_FILES_H
#define TRACKD_INPUT_FILES_H
#include "common.h"
#include "gait.h"

/* ---- binary PGM (P5) and PPM (P6) images of 8 bits. */
/* `out` points into `bytes`, which the caller frees. */
bool pnm_read(const char *path, file_bytes *bytes, gait_image *out, message *why);

/* ---- where the person is at one frame, by the project's init JSON; same rules as python/gait/bindings/initial.py. */
typedef struct init_state {
    int64_t frame; /* number of the frame; -1: the first one */
    gait_state mean, sd;
} init_state;

/* Keys that the file lacks are taken from the model's prior, the height of the pelvis from its kinematics. */
bool init_file_read(const char *path, const gait_model *model, init_state *out, message *why);
#endif
