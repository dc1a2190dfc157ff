/* common.h - what every part uses: one-line errors, whole files in memory, models, the pool of threads, clocks. */
#ifndef TRACKD_COMMON_H
#define TRACKD_COMMON_H
#include "gait.h"
#include "gait_pool.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>

/* ---- one line that reports a fault, set where it is found. */
typedef struct message {
    char text[640]; /* holds two long paths and a reason */
} message;

/* Write the line, with everything that text from outside could do to a terminal or a log made visible: control characters
 * and bytes that are not UTF-8 become \xNN. */
void message_format(message *m, const char *format, va_list args) __attribute__((format(printf, 2, 0)));
/* The same; always returns false, so that a caller can end with `return message_set(...)`. */
bool message_set(message *m, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Print a line to stderr. */
void log_line(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* The same for everything that a message can cause: at most ten lines a second, then their number. */
void log_event(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* ---- clocks, microseconds. */
int64_t clock_wall(void);      /* since the Unix epoch */
int64_t clock_monotonic(void); /* from an arbitrary origin, unaffected by setting the date */
/* Whether a time in a message is one: 0 or more, and so that sums and differences of two fit. */
bool clock_check(int64_t utime, message *why);

/* ---- memory aligned to GAIT_ALIGN, as the library requires; free() it.  NULL, with `why` set, if there is not enough. */
void *aligned_memory(size_t bytes, const char *what, message *why);

/* ---- a whole file in memory. */
typedef struct file_bytes {
    unsigned char *data; /* aligned to GAIT_ALIGN, with a NUL after the last byte; free() it */
    size_t size;         /* without that NUL */
} file_bytes;

/* Most bytes of a file, far more than a model, a camera or an image has, and than eight people of many particles: a wrong
 * file must not fill the memory. */
typedef enum { FILE_MOST = 1 << 25, SNAPSHOT_MOST = 1 << 28 } file_most;

/* `what` names the kind of file in the message: "model". */
bool file_read(const char *path, const char *what, file_most most, file_bytes *out, message *why);

/* ---- a model read from its file, in memory that is allocated once. */
typedef struct model_file {
    file_bytes blob;
    void *memory;
    gait_model *model;
    size_t bytes; /* of blob and model */
} model_file;

bool model_file_open(model_file *m, const char *path, message *why);
void model_file_close(model_file *m);

/* ---- the library's pool of threads in memory of its own. */
typedef struct workers {
    gait_pool *pool;
    void *memory;
    size_t bytes;
} workers;

/* `threads` in all, the caller's included. */
bool workers_start(workers *w, int32_t threads, message *why);
void workers_stop(workers *w);
#endif
