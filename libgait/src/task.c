#include "task.h"

typedef struct split {
    task_range_fn *fn;
    void *ctx;
    int32_t tasks, items, block;
} split;

/* First item of a task's range; of task `tasks`: the end. */
static int32_t range_begin(const split *s, int32_t task)
{
    int64_t const blocks = ((int64_t)s->items + s->block - 1) / s->block;
    int64_t const first = blocks * task / s->tasks * s->block;
    return first < s->items ? (int32_t)first : s->items;
}

static void run_one(void *ctx, int32_t task)
{
    const split *const s = ctx;
    s->fn(s->ctx, range_begin(s, task), range_begin(s, task + 1), task);
}

void task_run(const gait_tasks *exec, int32_t tasks, int32_t items, int32_t block, task_range_fn *fn,
              void *ctx)
{
    GAIT_ASSERT(tasks > 0 && items >= 0 && block > 0);
    split s = {.fn = fn, .ctx = ctx, .tasks = tasks, .items = items, .block = block};
    if (exec->run) {
        exec->run(exec->user, run_one, &s, tasks);
        return;
    }
    for (int32_t task = 0; task < tasks; task++)
        run_one(&s, task);
}
