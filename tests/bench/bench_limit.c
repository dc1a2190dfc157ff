#include "bench_limit.h"
#include "bench_clock.h"
#include "gait.h"

#include <stdlib.h>

enum { LIMBS = LIMIT_PARTICLES * LIMIT_LIMBS, BYTES = LIMBS * LIMIT_SAMPLES, RUNS = 15 };

#if defined(__x86_64__)
#define ISAS(S)                                                                                              \
    S(scalar, 0)                                                                                             \
    S(base, GAIT_CPU_BASE) S(sse4, GAIT_CPU_SSE4) S(avx2, GAIT_CPU_AVX2) S(avx512, GAIT_CPU_AVX512)
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

/* Limbs of one person 190 pixels tall, slightly displaced in every particle; half of the particles had children. */
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

static void choose(bench_limit *b, uint32_t usable)
{
#define CONSIDER(isa, bit)                                                                                   \
    if (((bit) & ~usable) == 0) {                                                                            \
        b->both = limit_both_##isa;                                                                          \
        b->kept = limit_kept_##isa;                                                                          \
    }
    ISAS(CONSIDER)
}

typedef struct arrays {
    uint32_t frame[2][LIMIT_SIZE * LIMIT_SIZE];
    limit_limb limb[LIMBS];
    int32_t parent[LIMIT_PARTICLES];
    uint8_t samples[2][BYTES];
    float cost[LIMBS];
} arrays;

bool bench_limit_make(bench_limit *b, uint32_t cpu_mask, message *why)
{
    arrays *const a = calloc(1, sizeof *a);
    *b = (bench_limit){.memory = a};
    if (!a)
        return message_set(why, "not enough memory for the limit kernel");
    b->work =
        (limit_work){a->frame[0], a->frame[1], a->limb, a->parent, a->samples[0], a->samples[1], a->cost};
    choose(b, cpu_mask & gait_cpu_features());
    draw(a->frame[0], 1);
    draw(a->frame[1], 2);
    scatter(a->limb, a->parent);
    return true;
}

void bench_limit_free(bench_limit *b)
{
    free(b->memory);
    b->memory = NULL;
}

double bench_limit_ms(const bench_limit *b, limit_kernel *kernel)
{
    double best = 1e9;
    for (int run = 0; run < RUNS; run++) {
        int64_t const begin = bench_cpu_ns();
        kernel(&b->work);
        double const ms = (double)(bench_cpu_ns() - begin) * 1e-6;
        best = ms < best ? ms : best;
    }
    return best;
}
