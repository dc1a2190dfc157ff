/* bench_verdict.h - what was asked of the tracker's speed beside what it reached in this run. */
#ifndef BENCH_VERDICT_H
#define BENCH_VERDICT_H
#include "bench_measure.h"

typedef struct verdict {
    const bench_result *usual;   /* default number of particles: one thread, two */
    const bench_result *search;  /* the same while the phase is unknown */
    const bench_result *many[2]; /* 10,000, by mode: one thread, two; in the first two trackers as well */
    const bench_result *isa[4];  /* the same with the stages, scalar first, best last */
    int isas;
    const bench_result *picture[3]; /* 640x480, 1280x720, 1920x1080 */
    double least, most;             /* particle_ratio from 1,000 to 100,000 of them */
} verdict;

/* Take a number of particles into least and most: one thread, with stages. */
void verdict_size(verdict *v, const bench_result *r);
void verdict_print(const verdict *v, const gait_model *model);
#endif
