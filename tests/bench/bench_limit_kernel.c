/* Compiled once per instruction set, like the library's kernels. */
#include "bench_limit.h"

#define JOIN(name, isa) name##_##isa
#define NAME(name, isa) JOIN(name, isa)
#define KERNEL(name)    NAME(name, KERNEL_ISA)

limit_kernel KERNEL(limit_both), KERNEL(limit_kept);

/* Samples of one limb: 16 along it, 4 across. */
static void read_points(const uint32_t *restrict frame, const limit_limb *l, int32_t *restrict out)
{
    for (int32_t i = 0; i < LIMIT_SAMPLES; i++) {
        float const s = (float)(i % 16) * (1.0f / 15), t = (float)(i / 16) * (2.0f / 3) - 1.0f;
        float const x = l->at[0] + s * l->along[0] + t * l->across[0];
        float const y = l->at[1] + s * l->along[1] + t * l->across[1];
        int32_t const col = (int32_t)x, row = (int32_t)y;
        int32_t const fx = (int32_t)((x - (float)col) * 256), fy = (int32_t)((y - (float)row) * 256);
        uint32_t const four = frame[row * LIMIT_SIZE + col];
        int32_t const a = four & 255, b = four >> 8 & 255, c = four >> 16 & 255, d = (int32_t)(four >> 24);
        int32_t const up = a * 256 + (b - a) * fx, down = c * 256 + (d - c) * fx;
        out[i] = (up * 256 + (down - up) * fy) >> 16;
    }
}

static float difference(const int32_t *a, const int32_t *b)
{
    int32_t sum = 0;
    for (int32_t i = 0; i < LIMIT_SAMPLES; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return (float)sum * (1.0f / LIMIT_SAMPLES);
}

void KERNEL(limit_both)(const limit_work *w)
{
    for (int32_t p = 0; p < LIMIT_PARTICLES; p++)
        for (int32_t l = 0; l < LIMIT_LIMBS; l++) {
            int32_t now[LIMIT_SAMPLES], then[LIMIT_SAMPLES];
            read_points(w->now, &w->limb[p * LIMIT_LIMBS + l], now);
            read_points(w->then, &w->limb[w->parent[p] * LIMIT_LIMBS + l], then);
            w->cost[p * LIMIT_LIMBS + l] = difference(now, then);
        }
}

void KERNEL(limit_kept)(const limit_work *w)
{
    for (int32_t p = 0; p < LIMIT_PARTICLES; p++)
        for (int32_t l = 0; l < LIMIT_LIMBS; l++) {
            int32_t now[LIMIT_SAMPLES], then[LIMIT_SAMPLES];
            const uint8_t *const known = w->known + (w->parent[p] * LIMIT_LIMBS + l) * LIMIT_SAMPLES;
            uint8_t *const out = w->samples + (p * LIMIT_LIMBS + l) * LIMIT_SAMPLES;
            read_points(w->now, &w->limb[p * LIMIT_LIMBS + l], now);
            for (int32_t i = 0; i < LIMIT_SAMPLES; i++) {
                then[i] = known[i];
                out[i] = (uint8_t)now[i];
            }
            w->cost[p * LIMIT_LIMBS + l] = difference(now, then);
        }
}
