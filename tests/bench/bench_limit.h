/* bench_limit.h - the limit of any texture likelihood on this machine: nothing but affine sample places, bilinear
 * look-ups and squared differences (the texture-only limit of doc/limits.md). */
#ifndef BENCH_LIMIT_H
#define BENCH_LIMIT_H
#include "trackd/common.h"

#include <stdint.h>

enum { LIMIT_PARTICLES = 10000, LIMIT_LIMBS = 10, LIMIT_SAMPLES = 64, LIMIT_SIZE = 256 };

typedef struct limit_limb { /* x = at[0] + s * along[0] + t * across[0], y likewise; pixels */
    float at[2], along[2], across[2];
} limit_limb;

typedef struct limit_work {
    const uint32_t *now, *then; /* LIMIT_SIZE^2 pixels, each with its three neighbours: one word a look-up */
    const limit_limb *limb;     /* [particles][limbs] */
    const int32_t *parent;      /* [particles], ascending */
    uint8_t *samples;           /* [particles][limbs][samples] of the present */
    const uint8_t *known;       /* the same of the ancestors, in the previous frame */
    float *cost;                /* [particles][limbs] */
} limit_work;

typedef void limit_kernel(const limit_work *w);

typedef struct bench_limit {
    limit_kernel *both, *kept; /* both frames read; the ancestor's samples kept from the previous frame */
    limit_work work;
    void *memory;
} bench_limit;

/* With the best instruction set in the mask (GAIT_CPU_*). */
bool bench_limit_make(bench_limit *b, uint32_t cpu_mask, message *why);
void bench_limit_free(bench_limit *b);
/* Milliseconds of CPU for all particles, the best of some runs. */
double bench_limit_ms(const bench_limit *b, limit_kernel *kernel);
#endif
