/* gait_pool.h - optional threads for gait_tracker_config.exec (POSIX), in the caller's memory.
 *
 * Start a pool with one thread per core to use, give gait_pool_tasks() to a tracker, and stop the pool when no tracker
 * uses it any more.  Results do not depend on the number of threads.  The library allocates no memory; the system
 * provides the threads' stacks.  A library built with GAIT_NO_THREADS does not have these functions. */
#ifndef GAIT_POOL_H
#define GAIT_POOL_H
#include "gait.h"

#define GAIT_POOL_MAX 256 /* threads */

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gait_pool gait_pool;

/* threads: total number, including the one that calls the tracker, in [1, GAIT_POOL_MAX]. */
GAIT_API gait_result gait_pool_bytes(int32_t threads, size_t *bytes, gait_error *err);
/* Start threads - 1 threads.  They go to sleep about half a millisecond (shared by all of them) after a job, and block
 * all signals.  mem must be aligned to GAIT_ALIGN and stay in place until gait_pool_stop().  GAIT_ERR_LIMIT: the
 * system could not create that many threads; none is left running. */
GAIT_API gait_result gait_pool_init(void *mem, size_t mem_bytes, int32_t threads, gait_pool **out, gait_error *err);
/* Can serve any number of trackers, one call at a time: steps of two trackers must not overlap.  Config tasks should
 * equal the number of threads. */
GAIT_API gait_tasks  gait_pool_tasks(gait_pool *p);
/* Stop and join the threads; the memory can then be reused. */
GAIT_API void        gait_pool_stop(gait_pool *p);

#ifdef __cplusplus
}
#endif
#endif
