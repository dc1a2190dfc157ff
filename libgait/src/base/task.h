/* task.h - parallel for over the caller's gait_tasks. */
#ifndef GAIT_BASE_TASK_H
#define GAIT_BASE_TASK_H
#include "base/base.h"

enum { TASK_MOST = 256 };

/* Work on items [begin, end) as piece `task`: its scratch is indexed by task. */
typedef void task_range_fn(void *ctx, int32_t begin, int32_t end, int32_t task);

/* Cut [0, items) into as many parts as there are tasks (1 .. TASK_MOST) and these into ranges that begin at multiples of
 * block.  A task takes ranges of its own part, the same in every run, whose data its core may still hold, then of the
 * others' until none is left: which task gets which depends on time, so what is done to an item must not depend on it.
 * exec->run NULL: the calling thread does all as task 0. */
void task_run(const gait_tasks *exec, int32_t tasks, int32_t items, int32_t block, task_range_fn *fn,
              void *ctx);
#endif
