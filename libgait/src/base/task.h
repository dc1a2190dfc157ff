/* task.h - parallel for loop over the caller's gait_tasks. */
#ifndef GAIT_BASE_TASK_H
#define GAIT_BASE_TASK_H
#include "base/base.h"

enum { TASK_MOST = 256 };

/* Process items [begin, end) as task number `task`, which selects the scratch memory. */
typedef void task_range_fn(void *ctx, int32_t begin, int32_t end, int32_t task);

/* Split [0, items) into one part per task (1 .. TASK_MOST) and each part into ranges that begin at multiples
 * of block. A task takes ranges of its own part first, whose data its core may still have in cache from the
 * last run, and then of the other parts until none is left. Which task processes an item depends on timing,
 * so the result for an item must not depend on it. If exec->run is NULL the calling thread does everything
 * as task 0. */
void task_run(const gait_tasks *exec, int32_t tasks, int32_t items, int32_t block, task_range_fn *fn,
              void *ctx);

/* The same, and once `beside` (NULL: nothing), which task 0 calls first while the other tasks begin with the items.  It
 * must not depend on them. */
void task_run_beside(const gait_tasks *exec, int32_t tasks, void (*beside)(void *ctx), int32_t items,
                     int32_t block, task_range_fn *fn, void *ctx);
#endif
