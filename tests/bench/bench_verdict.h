/* bench_verdict.h - targets for the tracker's speed, and what this run reached. */
#ifndef BENCH_VERDICT_H
#define BENCH_VERDICT_H
#include "bench_measure.h"

enum { BENCH_SETS = 5 }; /* instruction sets of a processor, scalar included */

typedef struct by_threads {
    const bench_result *one, *two; /* threads of a tracker */
    const bench_result *twins;     /* two trackers at the same time, a thread each; or NULL */
} by_threads;

typedef struct verdict {
    by_threads usual;                    /* default number of particles */
    by_threads search;                   /* the same while the phase is unknown */
    by_threads many[2];                  /* 10,000, by mode */
    const bench_result *isa[BENCH_SETS]; /* the same with the stages, scalar first, best last */
    int isas;
    const bench_result *slow[2][BENCH_SETS]; /* default number of particles, and 500, without the best set */
    int slows;
    const bench_result *picture[3]; /* 640x480, 1280x720, 1920x1080 */
    double least, most;             /* particle_ratio from 1,000 to 100,000 of them */
} verdict;

/* Take a number of particles into least and most: one thread, with stages. */
void verdict_size(verdict *v, const bench_result *r);
void verdict_print(const verdict *v, const gait_model *model);
#endif
