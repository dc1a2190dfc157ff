/* gait_pool.h - optional threads for gait_tracker_config.exec (POSIX), in memory of the caller.
 *
 * Start a pool of as many threads as cores are to work, give gait_pool_tasks() to a tracker, stop the pool when no
 * tracker uses it any more.  Results do not depend on the number of threads.  The library takes no memory; the
 * threads' stacks are the system's.  A library built with GAIT_NO_THREADS has none of these functions. */
#ifndef GAIT_POOL_H
#define GAIT_POOL_H
#include "gait.h"

#define GAIT_POOL_MAX 256 /* threads */

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gait_pool gait_pool;

/* threads: in all, the one that calls the tracker included [1, GAIT_POOL_MAX]. */
GAIT_API gait_result gait_pool_bytes(int32_t threads, size_t *bytes, gait_error *err);
/* Start threads - 1 threads; they sleep from about half a millisecond (shared by all of them) after a job until the
 * next one and take no signals.  mem is aligned to GAIT_ALIGN and must stay until gait_pool_stop().  GAIT_ERR_LIMIT: the
 * system refuses that many, none is left. */
GAIT_API gait_result gait_pool_init(void *mem, size_t mem_bytes, int32_t threads, gait_pool **out, gait_error *err);
/* For any number of trackers, one call at a time: steps of two trackers must not overlap.  Config tasks should be
 * the number of threads. */
GAIT_API gait_tasks  gait_pool_tasks(gait_pool *p);
/* End and join the threads; the memory is the caller's again. */
GAIT_API void        gait_pool_stop(gait_pool *p);

#ifdef __cplusplus
}
#endif
#endif
