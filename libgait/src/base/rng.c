#include "base/rng.h"

void rng_bits(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw, uint32_t out[4])
{
    rng_words(seed, stream, frame, index, draw, out);
}

void rng_uniform4(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw, float out[4])
{
    uint32_t bits[4];
    rng_words(seed, stream, frame, index, draw, bits);
    for (int i = 0; i < 4; i++)
        out[i] = rng_unit(bits[i]);
}

void rng_normal4(uint64_t seed, uint32_t stream, uint32_t frame, uint32_t index, uint32_t draw, float out[4])
{
    uint32_t bits[4];
    rng_words(seed, stream, frame, index, draw, bits);
    rng_normal_pair(bits[0], bits[1], out, out + 1);
    rng_normal_pair(bits[2], bits[3], out + 2, out + 3);
}
