/* workers.h - the library's pool of threads in memory of its own. */
#ifndef TRACKD_WORKERS_H
#define TRACKD_WORKERS_H
#include "gait_pool.h"
#include "message.h"

typedef struct workers {
    gait_pool *pool;
    void *memory;
    size_t bytes;
} workers;

/* `threads` in all, the caller's included. */
bool workers_start(workers *w, int32_t threads, message *why);
void workers_stop(workers *w);
#endif
