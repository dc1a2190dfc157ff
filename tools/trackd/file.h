/* file.h - a whole file in memory. */
#ifndef TRACKD_FILE_H
#define TRACKD_FILE_H
#include "message.h"

#include <stddef.h>

typedef struct file_bytes {
    unsigned char *data; /* aligned to GAIT_ALIGN, with a NUL after the last byte; free() it */
    size_t size;         /* without that NUL */
} file_bytes;

/* `what` names the kind of file in the message: "model". */
bool file_read(const char *path, const char *what, file_bytes *out, message *why);
#endif
