/* model_file.h - a model read from its file, in memory that is taken once. */
#ifndef TRACKD_MODEL_FILE_H
#define TRACKD_MODEL_FILE_H
#include "file.h"
#include "gait.h"

typedef struct model_file {
    file_bytes blob;
    void *memory;
    gait_model *model;
    size_t bytes; /* of blob and model */
} model_file;

bool model_file_open(model_file *m, const char *path, message *why);
void model_file_close(model_file *m);
#endif
