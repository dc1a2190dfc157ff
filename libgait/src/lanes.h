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

#if defined(__AVX512VBMI__)
#define LANES_BYTES 4 /* rows of LANES bytes in a register */

static inline __m512i bytes_load(const int8_t *const *row)
{
    __m512i v = _mm512_castsi128_si512(_mm_loadu_si128((const __m128i_u *)row[0]));
    v = _mm512_inserti32x4(v, _mm_loadu_si128((const __m128i_u *)row[1]), 1);
    v = _mm512_inserti32x4(v, _mm_loadu_si128((const __m128i_u *)row[2]), 2);
    return _mm512_inserti32x4(v, _mm_loadu_si128((const __m128i_u *)row[3]), 3);
}

/* table[index], 0 .. 255 */
static inline __m512i bytes_lookup(const uint8_t *table, __m512i index)
{
    __m512i const low =
        _mm512_permutex2var_epi8(_mm512_loadu_si512(table), index, _mm512_loadu_si512(table + 64));
    __m512i const high =
        _mm512_permutex2var_epi8(_mm512_loadu_si512(table + 128), index, _mm512_loadu_si512(table + 192));
    return _mm512_mask_blend_epi8(_mm512_movepi8_mask(index), low, high);
}

/* For each pair of rows the sum over differences d, where neither byte is `none`, of low[d] + 2^8 high[d] + 2^24. */
static inline void bytes_costs(const int8_t *const *a, const int8_t *const *b, int8_t none,
                               const uint8_t *low, const uint8_t *high, int32_t *sum)
{
    __m512i const x = bytes_load(a), y = bytes_load(b), no = _mm512_set1_epi8(none),
                  zero = _mm512_setzero_si512();
    __m512i const d = _mm512_sub_epi8(_mm512_max_epi8(x, y), _mm512_min_epi8(x, y));
    __mmask64 const both = _mm512_mask_cmpneq_epi8_mask(_mm512_cmpneq_epi8_mask(x, no), y, no);
    __m512i const l = _mm512_sad_epu8(_mm512_maskz_mov_epi8(both, bytes_lookup(low, d)), zero);
    __m512i const h = _mm512_sad_epu8(_mm512_maskz_mov_epi8(both, bytes_lookup(high, d)), zero);
    __m512i const n = _mm512_sad_epu8(_mm512_maskz_set1_epi8(both, 1), zero);
    __m512i const half = l + (h << 8) + (n << 24); /* of a row, twice in each */
    __m512i const all = half + _mm512_shuffle_epi32(half, _MM_PERM_BADC);
    __m512i const first = _mm512_permutexvar_epi64(_mm512_setr_epi64(0, 2, 4, 6, 0, 0, 0, 0), all);
    _mm_storeu_si128((__m128i_u *)sum, _mm256_cvtepi64_epi32(_mm512_castsi512_si256(first)));
}
#endif

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
