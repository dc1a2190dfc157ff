/* lanes.h - for kernels, what compilers do not find out in loops over sixteen elements. */
#ifndef GAIT_LANES_H
#define GAIT_LANES_H
#include <stdint.h>

enum { LANES = 16 };

#if defined(__AVX2__)
#include <immintrin.h>

/* An unconditional gather would wait for what its register held before. */
static inline __m256i lookup8(const void *table, __m256i index, __m256i take)
{
    return _mm256_mask_i32gather_epi32(_mm256_setzero_si256(), table, index, take, 4);
}
#endif

/* out[i] = table[index[i]] where take[i] is -1, and 0 where it is 0. */
static inline void lookup(const void *table, const int32_t *index, const int32_t *take, int32_t *out)
{
#if defined(__AVX512F__) /* two of eight are faster than one of sixteen */
    __m512i const at = _mm512_loadu_si512(index), on = _mm512_loadu_si512(take);
    __m256i const low = lookup8(table, _mm512_castsi512_si256(at), _mm512_castsi512_si256(on));
    __m256i const high = lookup8(table, _mm512_extracti64x4_epi64(at, 1), _mm512_extracti64x4_epi64(on, 1));
    _mm512_storeu_si512(out, _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1));
#elif defined(__AVX2__)
    for (int32_t i = 0; i < LANES; i += 8)
        _mm256_storeu_si256((__m256i_u *)(out + i),
                            lookup8(table, _mm256_loadu_si256((const __m256i_u *)(index + i)),
                                    _mm256_loadu_si256((const __m256i_u *)(take + i))));
#else
    typedef int32_t __attribute__((may_alias)) word;
    for (int32_t i = 0; i < LANES; i++)
        out[i] = take[i] ? ((const word *)table)[index[i]] : 0;
#endif
}

/* Bytes to words: in pieces, what follows would wait for them. */
static inline void widen(const int8_t *in, int32_t *out)
{
#if defined(__AVX512F__)
    _mm512_storeu_si512(out, _mm512_cvtepi8_epi32(_mm_loadu_si128((const __m128i_u *)in)));
#elif defined(__AVX2__)
    for (int32_t i = 0; i < LANES; i += 8)
        _mm256_storeu_si256((__m256i_u *)(out + i), _mm256_cvtepi8_epi32(_mm_loadu_si64(in + i)));
#else
    for (int32_t i = 0; i < LANES; i++)
        out[i] = in[i];
#endif
}

/* Words to bytes, which they fit. */
static inline void narrow(const int32_t *in, int8_t *out)
{
#if defined(__AVX512F__)
    _mm_storeu_si128((__m128i_u *)out, _mm512_cvtepi32_epi8(_mm512_loadu_si512(in)));
#elif defined(__AVX2__)
    __m256i const low = _mm256_loadu_si256((const __m256i_u *)in);
    __m256i const high = _mm256_loadu_si256((const __m256i_u *)(in + 8));
    __m256i const half = _mm256_permute4x64_epi64(_mm256_packs_epi32(low, high), 0xd8);
    _mm_storeu_si128((__m128i_u *)out,
                     _mm_packs_epi16(_mm256_castsi256_si128(half), _mm256_extracti128_si256(half, 1)));
#else
    for (int32_t i = 0; i < LANES; i++)
        out[i] = (int8_t)in[i];
#endif
}

/* Sixteen numbers of sixteen bodies: from in[number][body] to out[body][number], a cache line each. */
static inline void deal(const float (*restrict in)[LANES], float (*restrict out)[LANES])
{
#if defined(__AVX2__)
    for (int32_t a = 0; a < LANES; a += 8)
        for (int32_t b = 0; b < LANES; b += 8) {
            __m256 r[8], s[8];
#pragma GCC unroll 8
            for (int32_t i = 0; i < 8; i++) /* four numbers of two halves of the bodies in each */
                r[i] =
                    _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(in[a + (i & 3)] + b + (i & 4))),
                                         _mm_loadu_ps(in[a + 4 + (i & 3)] + b + (i & 4)), 1);
#pragma GCC unroll 4
            for (int32_t i = 0; i < 8; i += 2) {
                s[i] = _mm256_unpacklo_ps(r[i], r[i + 1]);
                s[i + 1] = _mm256_unpackhi_ps(r[i], r[i + 1]);
            }
#pragma GCC unroll 2
            for (int32_t i = 0; i < 8; i += 4)
#pragma GCC unroll 2
                for (int32_t k = 0; k < 2; k++) {
                    __m256d const low = _mm256_castps_pd(s[i + k]), high = _mm256_castps_pd(s[i + 2 + k]);
                    _mm256_storeu_pd((double *)(void *)(out[b + i + 2 * k] + a),
                                     _mm256_unpacklo_pd(low, high));
                    _mm256_storeu_pd((double *)(void *)(out[b + i + 2 * k + 1] + a),
                                     _mm256_unpackhi_pd(low, high));
                }
        }
#else
    for (int32_t b = 0; b < LANES; b++)
        for (int32_t a = 0; a < LANES; a++)
            out[b][a] = in[a][b];
#endif
}
#endif
