/* bench_measure.h - one tracker over a scene: time of a step, of its stages, memory, digest. */
#ifndef BENCH_MEASURE_H
#define BENCH_MEASURE_H
#include "bench_scene.h"
#include "bench_stages.h"

typedef struct bench_plan {
    int32_t mode, particles, threads;
    uint32_t cpu_mask;
    int32_t steps; /* over all rounds through the scene */
    bool stages;   /* time the stages as well, which takes a little time itself */
} bench_plan;

typedef struct bench_result {
    bench_plan plan;
    int32_t width, height;
    const char *isa;
    size_t bytes;                  /* of the tracker */
    double median_ms, p99_ms;      /* of a step, time of day */
    double cpu_ms, cpu_p99_ms;     /* of the calling thread, which other programs do not lengthen */
    double stage_ms[BENCH_STAGES]; /* median, CPU; 0 without stages */
    uint64_t digest;               /* after the first round */
} bench_result;

bool bench_measure(const gait_model *model, const bench_scene *s, const bench_plan *plan, bench_result *out,
                   message *why);
#endif
