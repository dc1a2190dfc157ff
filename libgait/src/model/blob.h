/* blob.h - container of a model file (doc/model-format.md): header, section table, checksum. blob_open
 * checks everything before anything is read; model.c interprets the sections. */
#ifndef GAIT_MODEL_BLOB_H
#define GAIT_MODEL_BLOB_H
#include "base/base.h"

enum { BLOB_U8 = 1, BLOB_I32 = 2, BLOB_F32 = 3 };
enum { BLOB_MAX_SECTIONS = 64 };

typedef struct blob {
    const unsigned char *data; /* the file in the caller's memory */
    size_t bytes;
    uint32_t sections;
} blob;

/* Check the whole container: magic, version, alignment, CRC, bounds, overlaps, unique tags. */
gait_result blob_open(const void *data, size_t bytes, blob *out, gait_error *err);

bool blob_has(const blob *b, const char tag[4]);

/* Elements of the section with this tag, type and rank, and its dimensions (unused ones are 1). NULL if
 * there is none. The pointer to an empty section must not be read. */
const void *blob_section(const blob *b, const char tag[4], uint32_t dtype, uint32_t rank, uint32_t dims[4]);
#endif
