#include "base/task.h"

#include <stdatomic.h>

enum { SHARES = 512 }; /* per part, so that no task waits long for another */

typedef struct work {
    void (*beside)(void *ctx); /* or NULL */
    task_range_fn *fn;
    void *ctx;
    int32_t items, tasks;
    int32_t part, share;        /* items of each */
    atomic_int next[TASK_MOST]; /* next share to hand out, of each part */
} work;

/* Take shares of one part until none is left. */
static void run_part(work *w, int32_t part, int32_t task)
{
    int64_t const first = (int64_t)part * w->part, end = first + w->part,
                  last = end < w->items ? end : w->items;
    for (int64_t at; (at = first + (int64_t)atomic_fetch_add(&w->next[part], 1) * w->share) < last;)
        w->fn(w->ctx, (int32_t)at, (int32_t)(at + w->share < last ? at + w->share : last), task);
}

static void run_one(void *ctx, int32_t task)
{
    work *const w = ctx;
    if (task == 0 && w->beside)
        w->beside(w->ctx);
    for (int32_t k = 0; k < w->tasks; k++)
        run_part(w, (task + k) % w->tasks, task);
}

void task_run_beside(const gait_tasks *exec, int32_t tasks, void (*beside)(void *ctx), int32_t items,
                     int32_t block, task_range_fn *fn, void *ctx)
{
    GAIT_ASSERT(tasks > 0 && tasks <= TASK_MOST && items >= 0 && block > 0);
    int32_t const parts = exec->run ? tasks : 1, blocks = items / block + (items % block > 0);
    int32_t const part = blocks / parts + (blocks % parts > 0);
    work w = {.beside = beside, .fn = fn, .ctx = ctx, .items = items, .tasks = parts};
    w.part = part * block;
    w.share = block * i_max(part / SHARES, 1);
    for (int32_t k = 0; k < parts; k++)
        atomic_init(&w.next[k], 0);
    if (exec->run)
        exec->run(exec->user, run_one, &w, tasks);
    else
        run_one(&w, 0);
}

void task_run(const gait_tasks *exec, int32_t tasks, int32_t items, int32_t block, task_range_fn *fn,
              void *ctx)
{
    task_run_beside(exec, tasks, NULL, items, block, fn, ctx);
}
