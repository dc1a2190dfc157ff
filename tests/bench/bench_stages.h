/* bench_stages.h - where the time of a step goes.
 *
 * The linker puts functions of bench_stages.c round those of the library (-Wl,--wrap), and the tracker's table of
 * kernels is mirrored for one that keeps time: the library itself has no hooks.  For one thread. */
#ifndef BENCH_STAGES_H
#define BENCH_STAGES_H
#include "gait.h"

#include <stdbool.h>

enum {
    STAGE_FEATURES,
    STAGE_RESAMPLE,
    STAGE_PROPAGATE,
    STAGE_LIKELIHOOD, /* all of the particles' work; what follows are its parts */
    STAGE_KINEMATICS,
    STAGE_PROJECTION,
    STAGE_RASTER,
    STAGE_SAMPLES,
    STAGE_TEXTURE,
    STAGE_SILHOUETTE,
    STAGE_EDGES,
    STAGE_TEMPLATE,
    STAGE_WEIGHTS, /* of the whole step again */
    STAGE_ESTIMATE,
    STAGE_LAG,
    BENCH_STAGES
};

extern const char *const bench_stage_name[BENCH_STAGES];
static inline bool bench_stage_is_part(int stage) /* of the likelihood */
{
    return stage > STAGE_LIKELIHOOD && stage < STAGE_WEIGHTS;
}

void bench_stages_enable(gait_tracker *t, bool on);
/* Milliseconds of a stage since the last call for it. */
double bench_stages_take(int stage);
/* What a likelihood compares, means over bodies while stages were timed: cells of the silhouette's grid that the body
 * covers; points of its surface and of its edges that are visible and read, of those it has. */
typedef struct bench_samples {
    double cells, surface, edges;
} bench_samples;
bench_samples bench_stages_samples(void);
#endif
