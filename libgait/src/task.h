/* task.h - parallel for over the caller's gait_tasks. */
#ifndef GAIT_TASK_H
#define GAIT_TASK_H
#include "base.h"

/* Work on items [begin, end) as piece `task`: its scratch is indexed by task. */
typedef void task_range_fn(void *ctx, int32_t begin, int32_t end, int32_t task);

/* Split [0, items) into `tasks` contiguous ranges that begin at multiples of block, and call fn once for each
 * task, also when its range is empty.  The split depends on the arguments alone, not on threads.
 * exec->run NULL: the calling thread does them in order. */
void task_run(const gait_tasks *exec, int32_t tasks, int32_t items, int32_t block, task_range_fn *fn,
              void *ctx);
#endif
