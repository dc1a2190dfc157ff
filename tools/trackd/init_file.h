/* init_file.h - where the walker is at one frame, by the project's init JSON; same rules as gait/core/initial.py. */
#ifndef TRACKD_INIT_FILE_H
#define TRACKD_INIT_FILE_H
#include "gait.h"
#include "message.h"

typedef struct init_state {
    int64_t frame; /* number of the frame at which it holds; -1: the first that comes */
    gait_state mean, sd;
} init_state;

/* What the file does not say comes from the model's prior, the height of the pelvis from the model itself. */
bool init_file_read(const char *path, const gait_model *model, init_state *out, message *why);
#endif
