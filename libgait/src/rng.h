/* rng.h - counter-based random numbers: Philox4x32-10 (Salmon et al. 2011).
 * A number is a pure function of (seed, stream, frame, index, draw): who asks, and when, does not matter. */
#ifndef GAIT_RNG_H
#define GAIT_RNG_H
#include "base.h"

/* Key = seed (low word first), counter = (index, draw, frame, stream). */
void rng_bits(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw, uint32_t out[4]);

/* Four uniforms in [0, 1), multiples of 2^-24. */
void rng_uniform4(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw,
                  float out[4]);

/* Four standard normals, |x| < 6.7 (Box-Muller). */
void rng_normal4(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw, float out[4]);
#endif
