/* init_file.h - where the walker is at one frame, by the project's init JSON. */
#ifndef TOOLS_INIT_FILE_H
#define TOOLS_INIT_FILE_H
#include "gait.h"
#include "message.h"

typedef struct init_state {
    int64_t frame; /* number of the frame at which it holds; -1: the first that comes */
    gait_state mean, sd;
} init_state;

/* On entry `io` holds the model's prior, which stays wherever the file has no key. */
bool init_file_read(const char *path, init_state *io, message *why);
#endif
