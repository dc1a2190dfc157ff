/* rng.h - counter-based random numbers: Philox4x32-10 (Salmon et al. 2011). A number is a pure function of
 * (seed, stream, frame, index, draw), so the order of the calls does not matter. */
#ifndef GAIT_BASE_RNG_H
#define GAIT_BASE_RNG_H
#include "base/fmath.h"

/* Key = seed (low word first), counter = (index, draw, frame, stream). */
void rng_bits(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw, uint32_t out[4]);

/* Four uniforms in [0, 1), multiples of 2^-24. */
void rng_uniform4(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw,
                  float out[4]);

/* Four standard normals, |x| < 6.7 (Box-Muller). */
void rng_normal4(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw, float out[4]);

/* ---- the same inline: a loop over the index becomes vector code ---- */

static inline void rng_words(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw,
                             uint32_t out[4])
{
    uint32_t c0 = index, c1 = draw, c2 = frame, c3 = stream;
    uint32_t k0 = (uint32_t)seed, k1 = (uint32_t)(seed >> 32);
    for (int round = 0; round < 10; round++) {
        uint64_t const p0 = (uint64_t)0xD2511F53u * c0, p1 = (uint64_t)0xCD9E8D57u * c2;
        c0 = (uint32_t)(p1 >> 32) ^ c1 ^ k0;
        c1 = (uint32_t)p1;
        c2 = (uint32_t)(p0 >> 32) ^ c3 ^ k1;
        c3 = (uint32_t)p0;
        k0 += 0x9E3779B9u; /* golden ratio */
        k1 += 0xBB67AE85u; /* sqrt(3) - 1 */
    }
    out[0] = c0;
    out[1] = c1;
    out[2] = c2;
    out[3] = c3;
}

/* The 24 high bits as a float in [0, 1). */
static inline float rng_unit(uint32_t bits)
{
    return (float)(int32_t)(bits >> 8) * 0x1p-24f;
}

/* Two standard normals of two words. */
static inline void rng_normal_pair(uint32_t first, uint32_t second, float *a, float *b)
{
    /* All 32 bits in (0, 1]: with 24 the tail would end at 5.8. */
    float const u = ((float)first + 1.0f) * 0x1p-32f;
    float const radius = __builtin_sqrtf(-2.0f * m_log(u));
    float s, c;
    m_sincos(TWO_PI_F * rng_unit(second), &s, &c);
    *a = radius * c;
    *b = radius * s;
}
#endif
