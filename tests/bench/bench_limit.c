#include "bench_limit.h"
#include "bench_clock.h"
#include "gait.h"

#include <stdlib.h>

enum { LIMBS = LIMIT_PARTICLES * LIMIT_LIMBS, BYTES = LIMBS * LIMIT_SAMPLES, RUNS = 15 };

#if defined(__x86_64__)
#define ISAS(S) S(scalar, 0) S(base, GAIT_CPU_BASE) S(avx2, GAIT_CPU_AVX2) S(avx512, GAIT_CPU_AVX512)
#else
#define ISAS(S) S(scalar, 0) S(base, GAIT_CPU_BASE)
#endif
#define DECLARE(isa, bit) extern limit_kernel limit_both_##isa, limit_kept_##isa;
ISAS(DECLARE)

static unsigned next(unsigned *state)
{
    return (*state = *state * 1664525u + 1013904223u) >> 8;
}

/* A picture with detail; each word holds a pixel and its neighbours to the right, below and between. */
static void draw(uint32_t *out, unsigned seed)
{
    static uint8_t grey[LIMIT_SIZE + 1][LIMIT_SIZE + 1];
    for (int y = 0; y <= LIMIT_SIZE; y++)
        for (int x = 0; x <= LIMIT_SIZE; x++)
            grey[y][x] = (uint8_t)next(&seed);
    for (int y = 0; y < LIMIT_SIZE; y++)
        for (int x = 0; x < LIMIT_SIZE; x++)
            *out++ = grey[y][x] | (uint32_t)grey[y][x + 1] << 8 | (uint32_t)grey[y + 1][x] << 16 |
                     (uint32_t)grey[y + 1][x + 1] << 24;
}

static float between(unsigned *seed, float low, float high)
{
    return low + (high - low) * (float)(next(seed) & 0xffff) / 65536.0f;
}

/* Limbs of one person 190 pixels tall, a little apart in every particle; half of the particles had children. */
static void scatter(limit_limb *limb, int32_t *parent)
{
    unsigned seed = 7;
    for (int32_t p = 0; p < LIMIT_PARTICLES; p++) {
        parent[p] = p & ~1;
        for (int32_t l = 0; l < LIMIT_LIMBS; l++)
            *limb++ = (limit_limb){
                .at = {between(&seed, 110, 140), 30 + 14 * (float)l + between(&seed, 0, 6)},
                .along = {between(&seed, -12, 12), between(&seed, 36, 44)},
                .across = {between(&seed, 6, 10), between(&seed, -2, 2)},
            };
    }
}

static double best_ms(limit_kernel *kernel, const limit_work *w)
{
    double best = 1e9;
    for (int run = 0; run < RUNS; run++) {
        int64_t const begin = bench_cpu_ns();
        kernel(w);
        double const ms = (double)(bench_cpu_ns() - begin) * 1e-6;
        best = ms < best ? ms : best;
    }
    return best;
}

bool bench_limit(uint32_t cpu_mask, double *both_ms, double *kept_ms, message *why)
{
    static uint32_t frame[2][LIMIT_SIZE * LIMIT_SIZE];
    uint32_t const usable = cpu_mask & gait_cpu_features();
    limit_kernel *both = NULL, *kept = NULL;
    limit_limb *const limb = malloc(LIMBS * sizeof *limb);
    int32_t *const parent = malloc(LIMIT_PARTICLES * sizeof *parent);
    uint8_t *const seen = calloc(2, BYTES);
    float *const cost = malloc(LIMBS * sizeof *cost);
    bool const ok = limb && parent && seen && cost;
    if (ok) {
        limit_work const w = {frame[0], frame[1], limb, parent, seen, seen + BYTES, cost};
#define CONSIDER(isa, bit)                                                                                   \
    if (((bit) & ~usable) == 0) {                                                                            \
        both = limit_both_##isa;                                                                             \
        kept = limit_kept_##isa;                                                                             \
    }
        ISAS(CONSIDER)
        draw(frame[0], 1);
        draw(frame[1], 2);
        scatter(limb, parent);
        *both_ms = best_ms(both, &w);
        *kept_ms = best_ms(kept, &w);
    }
    free(limb);
    free(parent);
    free(seen);
    free(cost);
    return ok || message_set(why, "not enough memory for the limit kernel");
}
