/* pool.h - threads for the library's tasks; results do not depend on how many there are. */
#ifndef TOOLS_POOL_H
#define TOOLS_POOL_H
#include "gait.h"
#include "message.h"

#include <pthread.h>

enum { POOL_MAX = 64 };

typedef struct pool {
    pthread_mutex_t lock;
    pthread_cond_t work, done;
    pthread_t thread[POOL_MAX];
    int threads; /* helpers; the caller of a step works as well */
    gait_task_fn *fn;
    void *ctx;
    int32_t next, count, left; /* task to hand out, tasks, tasks not returned */
    bool quit;
} pool;

/* `threads` in all, the caller's included [1, POOL_MAX].  The pool must not move until pool_stop(). */
bool pool_start(pool *p, int threads, message *why);
void pool_stop(pool *p);
/* What gait_tracker_config.exec wants. */
gait_tasks pool_tasks(pool *p);
#endif
