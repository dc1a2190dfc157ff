#include "task.h"

#include <stdatomic.h>

enum { SHARES = 32 }; /* of a task, on average: so that none waits long for another */

typedef struct work {
    task_range_fn *fn;
    void *ctx;
    int32_t items, share;
    atomic_int next; /* share to hand out */
} work;

/* Take shares until none is left. */
static void run_one(void *ctx, int32_t task)
{
    work *const w = ctx;
    for (int64_t begin; (begin = (int64_t)atomic_fetch_add(&w->next, 1) * w->share) < w->items;) {
        int64_t const end = begin + w->share;
        w->fn(w->ctx, (int32_t)begin, end < w->items ? (int32_t)end : w->items, task);
    }
}

void task_run(const gait_tasks *exec, int32_t tasks, int32_t items, int32_t block, task_range_fn *fn,
              void *ctx)
{
    GAIT_ASSERT(tasks > 0 && items >= 0 && block > 0);
    int32_t const blocks = items / block + (items % block > 0), least = blocks / (tasks * SHARES);
    work w = {.fn = fn, .ctx = ctx, .items = items, .share = block * i_max(least, 1)};
    if (exec->run)
        exec->run(exec->user, run_one, &w, tasks);
    else
        run_one(&w, 0);
}
