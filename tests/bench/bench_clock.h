/* bench_clock.h - time of this thread on a CPU, which other programs do not lengthen, and time of day. */
#ifndef BENCH_CLOCK_H
#define BENCH_CLOCK_H
#include <stdint.h>
#include <time.h>

static inline int64_t bench_ns(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static inline int64_t bench_cpu_ns(void)
{
    return bench_ns(CLOCK_THREAD_CPUTIME_ID);
}

static inline int64_t bench_wall_ns(void)
{
    return bench_ns(CLOCK_MONOTONIC);
}
#endif
