/* bench_measure.h - trackers over a scene: time of a step, of its stages, memory, digest.
 *
 * What is compared takes turns, a few steps each, and a ratio is the median over the steps: other programs, the clock
 * and the host of a virtual machine change a processor's speed by more than the differences to be measured. */
#ifndef BENCH_MEASURE_H
#define BENCH_MEASURE_H
#include "bench_scene.h"
#include "bench_stages.h"

enum { BENCH_TURNS = 8 }; /* trackers that can take turns */

typedef struct bench_plan {
    const bench_scene *scene; /* until it is measured */
    int32_t mode, particles, threads;
    uint32_t cpu_mask;
    int32_t steps;  /* to measure; the first plan's counts for all that take turns; 0: see rounds */
    int32_t rounds; /* passes through the whole scene; each measures every frame but the first */
    bool stages;    /* time the stages as well, which takes a little time itself */
    bool
        limit; /* the texture-only limit takes turns with it, on one core and with the best instruction set */
    bool twins;  /* two trackers at the same time, each on one of the two threads */
    bool search; /* start with the phase unknown; the scene must end before that is settled */
} bench_plan;

typedef struct bench_result {
    bench_plan plan;
    int32_t width, height;
    const char *isa;
    int32_t particles;             /* in the last step: more than configured during acquisition */
    size_t bytes;                  /* of the tracker */
    double median_ms, p99_ms;      /* of a step, time of day */
    double cpu_ms, cpu_p99_ms;     /* of the calling thread, which other programs do not lengthen */
    double stage_ms[BENCH_STAGES]; /* median, CPU; 0 without stages */
    double limit_ms, limit_ratio;  /* CPU of the limit in these turns; a step to it by time of day; medians */
    double kept_ms;                /* CPU of the limit with the ancestor's samples kept, with the stages */
    double limit_p99_ms; /* as cpu_p99_ms; its work never changes, so that more is the machine's doing */
    /* Each frame's least time over the rounds, which is the work's own: the slowest frame's to their median.  By time of
     * day, by the calling thread's; 0 of fewer than two rounds. */
    double slowest, cpu_slowest;
    /* With the stages, medians of CPU time: likelihood to the limit with two look-ups, and with one kept. */
    double stage_ratio[2];
    double ratio; /* step by step to the first that took turns with it, median: time of day, */
    double
        particle_ratio; /* and CPU time per particle without the features, which are the same for any number */
    uint64_t digest;    /* after the first round */
} bench_result;

/* Measure by the plans in results[0 .. count). */
bool bench_measure(const gait_model *model, bench_result *results, int32_t count, message *why);
#endif
