/* simd16.h - SIMD code for kernels where compilers do not find it in loops over sixteen elements. */
#ifndef GAIT_BASE_SIMD16_H
#define GAIT_BASE_SIMD16_H
#include "base/grid_mask.h"
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { SIMD16 = 16 };

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__SSE2__) && !defined(KERNEL_SCALAR)
#include <immintrin.h>
#define SIMD16_SSE2
#elif defined(__aarch64__) && !defined(KERNEL_SCALAR)
#include <arm_neon.h>
#define SIMD16_NEON
#endif

#if defined(SIMD16_SSE2) || defined(SIMD16_NEON)
#define SIMD4_F
typedef float simd4_f __attribute__((vector_size(16)));

static inline simd4_f simd4_all(float x)
{
    return (simd4_f){x, x, x, x};
}

static inline simd4_f simd4_load(const float *from)
{
    simd4_f x;
    memcpy(&x, from, sizeof x);
    return x;
}
#endif
#if (defined(__SSE4_1__) && defined(SIMD16_SSE2)) || defined(SIMD16_NEON)
#define SIMD4 /* shuffles of bytes: masks are drawn and read in registers of four numbers */
#endif

/* A word or byte that is read by itself: compilers would build vectors of such, which takes longer. */
static inline uint32_t simd16_single(uint32_t x)
{
#if defined(__GNUC__) && !defined(KERNEL_SCALAR)
    __asm__("" : "+r"(x));
#endif
    return x;
}

/* Before elements are read one by one: from memory. */
#if defined(__GNUC__) && !defined(KERNEL_SCALAR)
#define SIMD16_STORED(array) __asm__("" : "+m"(array))
#else
#define SIMD16_STORED(array) ((void)0)
#endif

#if defined(__AVX2__)
/* With a mask, even a full one, a gather does not wait for the old value of its register. The scale must be a
 * constant. */
static inline __m256i simd16_lookup8(const void *table, int32_t bytes, __m256i index, __m256i take)
{
    __m256i const none = _mm256_setzero_si256();
    return bytes == 2 ? _mm256_mask_i32gather_epi32(none, table, index, take, 2)
                      : _mm256_mask_i32gather_epi32(none, table, index, take, 4);
}
#endif

#if defined(__AVX512F__)
#pragma GCC diagnostic push /* unoptimised, gcc's gather is a macro that changes the sign of a mask */
#pragma GCC diagnostic ignored "-Wsign-conversion"
static inline __m512i simd16_lookup16(const void *table, int32_t bytes, __m512i index, __mmask16 take)
{
    __m512i const none = _mm512_setzero_si512();
    return bytes == 2 ? _mm512_mask_i32gather_epi32(none, take, index, table, 2)
                      : _mm512_mask_i32gather_epi32(none, take, index, table, 4);
}
#pragma GCC diagnostic pop
#endif

/* out[i] = the word `bytes` (2 or 4) times index[i] into the table where take[i] is negative, elsewhere anything;
 * i < count, a multiple of SIMD16. Every index must be in the table. */
static inline void simd16_read(int32_t bytes, const void *table, const int32_t *index, const int32_t *take,
                               int32_t count, int32_t *out)
{
#if defined(__AVX512F__)
    for (int32_t i = 0; i < count; i += 16) {
        __mmask16 const on = _mm512_movepi32_mask(_mm512_loadu_si512(take + i));
        _mm512_storeu_si512(out + i, simd16_lookup16(table, bytes, _mm512_loadu_si512(index + i), on));
    }
#elif defined(__AVX2__)
    for (int32_t i = 0; i < count; i += 8)
        _mm256_storeu_si256((__m256i_u *)(out + i),
                            simd16_lookup8(table, bytes, _mm256_loadu_si256((const __m256i_u *)(index + i)),
                                           _mm256_loadu_si256((const __m256i_u *)(take + i))));
#else
    (void)take;
#pragma GCC unroll 8
    for (int32_t i = 0; i < count; i++) { /* out may be index */
        uint32_t found;
        memcpy(&found, (const char *)table + (size_t)bytes * (uint32_t)index[i], sizeof found);
        out[i] = (int32_t)simd16_single(found);
    }
#endif
}

/* The same of words of four bytes, elsewhere 0. */
static inline void simd16_lookup(const void *table, const int32_t *index, const int32_t *take, int32_t count,
                                 int32_t *out)
{
    simd16_read(4, table, index, take, count, out);
#if !defined(__AVX2__)
    for (int32_t i = 0; i < count; i++)
        out[i] &= take[i] >> 31;
#endif
}

#if defined(__AVX512BW__)
#define SIMD16_WORDS 16 /* words in a register */
typedef __m512i simd16_words;
#define WORDS_OP(op)   _mm512_##op
#define WORDS_BITS(op) _mm512_##op##_si512
#elif defined(__AVX2__)
#define SIMD16_WORDS   8
typedef __m256i simd16_words;
#define WORDS_OP(op)   _mm256_##op
#define WORDS_BITS(op) _mm256_##op##_si256
#elif defined(SIMD16_SSE2)
#define SIMD16_WORDS   4
typedef __m128i simd16_words;
#define WORDS_OP(op)   _mm_##op
#define WORDS_BITS(op) _mm_##op##_si128
#endif

#if defined(SIMD16_WORDS)
static inline simd16_words words_load(const int32_t *v)
{
    return WORDS_BITS(loadu)((const void *)v);
}

static inline void words_store(int32_t *v, simd16_words w)
{
    WORDS_BITS(storeu)((void *)v, w);
}

/* For each word, 256 - fraction in the low half and the fraction (low byte) in the high half. */
static inline simd16_words words_shares(simd16_words v)
{
    simd16_words const f = WORDS_BITS (and)(v, WORDS_OP(set1_epi32)(255));
    return WORDS_OP(add_epi32)(WORDS_OP(slli_epi32)(f, 16),
                               WORDS_OP(sub_epi32)(WORDS_OP(set1_epi32)(256), f));
}
#endif

/* Bilinear interpolation between the four bytes of a word (left, left below, right, right below), with
 * fractions in 1/256 in the low bytes of u and v; rounded towards 0. */
static inline void simd16_bilinear(const int32_t *four, const int32_t *u, const int32_t *v, int32_t *out)
{
#if defined(SIMD16_WORDS)
    for (int32_t i = 0; i < SIMD16; i += SIMD16_WORDS) {
        simd16_words const w = words_load(four + i), across = words_shares(words_load(u + i));
        simd16_words const even = WORDS_OP(srai_epi16)(WORDS_OP(slli_epi16)(w, 8), 8);
        simd16_words const top = WORDS_OP(madd_epi16)(even, across);
        simd16_words const low = WORDS_OP(madd_epi16)(WORDS_OP(srai_epi16)(w, 8), across);
        simd16_words const both = WORDS_OP(add_epi32)(WORDS_OP(slli_epi32)(low, 16),
                                                      WORDS_BITS (and)(top, WORDS_OP(set1_epi32)(65535)));
        simd16_words const sum = WORDS_OP(madd_epi16)(both, words_shares(words_load(v + i)));
        simd16_words const up = WORDS_OP(srli_epi32)(WORDS_OP(srai_epi32)(sum, 31), 16);
        words_store(out + i, WORDS_OP(srai_epi32)(WORDS_OP(add_epi32)(sum, up), 16));
    }
#else
    for (int32_t i = 0; i < SIMD16; i++) {
        int32_t const fx = u[i] & 255, fy = v[i] & 255;
        uint32_t const w = (uint32_t)four[i];
        int32_t const left = (int32_t)(w << 24) >> 24, left_low = (int32_t)(w << 16) >> 24;
        int32_t const right = (int32_t)(w << 8) >> 24, right_low = (int32_t)w >> 24;
        int32_t const top = left * 256 + (right - left) * fx;
        int32_t const low = left_low * 256 + (right_low - left_low) * fx;
        out[i] = (top * 256 + (low - top) * fy) / 65536;
    }
#endif
}

#if defined(__AVX512VBMI__)
#define SIMD16_BILINEAR_BYTES
/* Bilinear interpolation of bytes at (u, v), in 1/256 of their distance, rounded towards 0, where shown is
 * negative; `hidden` elsewhere. pairs: each byte with the one below it, 256 in a row. */
static inline void simd16_bilinear_bytes(const uint16_t *pairs, const int32_t *u, const int32_t *v,
                                         const int32_t *shown, int8_t hidden, int8_t *out)
{
    __m512i const x = _mm512_loadu_si512(u), y = _mm512_loadu_si512(v), low = _mm512_set1_epi32(255);
    __m512i const at = _mm512_ternarylogic_epi32(_mm512_srai_epi32(x, 8), y, low, 0xf4);
    __mmask16 const take = _mm512_movepi32_mask(_mm512_loadu_si512(shown));
    __m512i const four = simd16_lookup16(pairs, 2, at, take);
    __m512i const bytes = _mm512_set4_epi32(0x0c0c0c0c, 0x08080808, 0x04040404, 0);
    __m512i const words = _mm512_or_si512(bytes, _mm512_set1_epi16((short)0x8000));
    __m512i const down = _mm512_xor_si512(_mm512_shuffle_epi8(y, bytes), _mm512_set1_epi32(0x00ff00ff));
    __m512i const left = _mm512_srai_epi16(_mm512_slli_epi16(four, 8), 8);
    __m512i const both = _mm512_add_epi16(_mm512_maddubs_epi16(down, four), left);
    __m512i const fx = _mm512_shuffle_epi8(x, words);
    __m512i const across = _mm512_mask_sub_epi16(fx, 0x55555555, _mm512_set1_epi16(256), fx);
    __m512i const sum = _mm512_madd_epi16(both, across);
    __m512i const whole =
        _mm512_mask_add_epi32(sum, _mm512_movepi32_mask(sum), sum, _mm512_set1_epi32(65535));
    __m512i const third = _mm512_set_epi64(0, 0, 0, 0, 0, 0, 0x3e3a36322e2a2622, 0x1e1a16120e0a0602);
    __m512i const value = _mm512_mask_permutexvar_epi8(_mm512_set1_epi8(hidden), take, third, whole);
    _mm_storeu_si128((__m128i_u *)out, _mm512_castsi512_si128(value));
}
#endif

/* Words to bytes; the values fit. */
static inline void simd16_narrow(const int32_t *in, int8_t *out)
{
#if defined(__AVX2__)
    __m256i const low = _mm256_loadu_si256((const __m256i_u *)in);
    __m256i const high = _mm256_loadu_si256((const __m256i_u *)(in + 8));
    __m256i const half = _mm256_permute4x64_epi64(_mm256_packs_epi32(low, high), 0xd8);
    _mm_storeu_si128((__m128i_u *)out,
                     _mm_packs_epi16(_mm256_castsi256_si128(half), _mm256_extracti128_si256(half, 1)));
#else
    for (int32_t i = 0; i < SIMD16; i++)
        out[i] = (int8_t)in[i];
#endif
}

/* The same as bytes, `hidden` where shown is not negative. */
static inline void simd16_bilinear_narrow(const int32_t *four, const int32_t *u, const int32_t *v,
                                          const int32_t *shown, int8_t hidden, int8_t *out)
{
    int32_t all[SIMD16];
    simd16_bilinear(four, u, v, all);
#pragma GCC unroll 1
    for (int32_t i = 0; i < SIMD16; i++)
        all[i] = shown[i] < 0 ? all[i] : hidden;
    simd16_narrow(all, out);
}

typedef struct simd16_sums {
    int32_t low, dot,
        count; /* of byte 0; of byte 1 times the low half of the pair plus byte 3 times the high half; words */
} simd16_sums;

/* Sums over `count` words, a multiple of SIMD16, where take is negative; the others must be 0. */
static inline simd16_sums simd16_sum_bytes(const int32_t *bytes, const int32_t *pair, const int32_t *take,
                                           int32_t count)
{
#if defined(SIMD16_WORDS)
    int32_t part[3][SIMD16_WORDS];
    simd16_words low = WORDS_OP(set1_epi32)(0), dot = low, taken = low;
    simd16_sums sum = {0, 0, 0};
    for (int32_t i = 0; i < count; i += SIMD16_WORDS) {
        simd16_words const w = words_load(bytes + i);
        low = WORDS_OP(add_epi32)(low, WORDS_BITS (and)(w, WORDS_OP(set1_epi32)(255)));
        dot =
            WORDS_OP(add_epi32)(dot, WORDS_OP(madd_epi16)(WORDS_OP(srai_epi16)(w, 8), words_load(pair + i)));
        taken = WORDS_OP(add_epi32)(taken, WORDS_OP(srli_epi32)(words_load(take + i), 31));
    }
    words_store(part[0], low);
    words_store(part[1], dot);
    words_store(part[2], taken);
    for (int32_t i = 0; i < SIMD16_WORDS; i++) {
        sum.low += part[0][i];
        sum.dot += part[1][i];
        sum.count += part[2][i];
    }
    return sum;
#else
    int32_t low = 0, dot = 0, taken = 0;
    for (int32_t i = 0; i < count; i++) {
        uint32_t const v = (uint32_t)bytes[i], p = (uint32_t)pair[i];
        low += (int32_t)(v & 255);
        dot +=
            ((int32_t)(v << 16) >> 24) * ((int32_t)(p << 16) >> 16) + ((int32_t)v >> 24) * ((int32_t)p >> 16);
        taken += (int32_t)((uint32_t)take[i] >> 31);
    }
    return (simd16_sums){low, dot, taken};
#endif
}

#if defined(__AVX512F__)
/* Sixteen numbers that are read repeatedly, in a register. */
#define SIMD16_LOADED(name, in)                                                                              \
    float name[SIMD16];                                                                                      \
    _mm512_storeu_ps(name, _mm512_loadu_ps(in))
#else
#define SIMD16_LOADED(name, in) const float *const name = (in)
#endif

/* out[i] is negative where bit column[i], modulo 32, of bits[i] is set. */
static inline void simd16_bit(const int32_t *bits, const int32_t *column, int32_t *out)
{
#if defined(SIMD16_SSE2) /* has no shift by lanes: powers of two are made as floats */
    for (int32_t i = 0; i < SIMD16; i += SIMD16_WORDS) {
        __m128i const power =
            _mm_add_epi32(_mm_and_si128(words_load(column + i), _mm_set1_epi32(31)), _mm_set1_epi32(127));
        __m128i const bit = _mm_cvttps_epi32(_mm_castsi128_ps(_mm_slli_epi32(power, 23))); /* 2^31: also */
        words_store(out + i, _mm_cmpeq_epi32(_mm_and_si128(words_load(bits + i), bit), bit));
    }
#else
    for (int32_t i = 0; i < SIMD16; i++)
        out[i] = (int32_t)((uint32_t)bits[i] << (~column[i] & 31));
#endif
}

#if defined(__AVX512VBMI__)
#define SIMD16_BYTES 4 /* rows of SIMD16 bytes in a register */
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

/* For each pair of rows, the sum over the elements where neither byte is `none` of low[d] + 2^8 high[d] +
 * 2^24, where d is the absolute difference. */
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

/* Fill out with the two numbers in turn, `count` in all, a multiple of eight. */
static inline void simd16_repeat(const float *two, int32_t count, float *restrict out)
{
#if defined(__AVX512F__)
    double both;
    memcpy(&both, two, sizeof both);
    for (int32_t i = 0; i < count; i += 16)
        _mm512_storeu_pd((double *)(void *)(out + i), _mm512_set1_pd(both));
#elif defined(__AVX2__)
    double both;
    memcpy(&both, two, sizeof both);
    for (int32_t i = 0; i < count; i += 8)
        _mm256_storeu_pd((double *)(void *)(out + i), _mm256_set1_pd(both));
#else
    for (int32_t i = 0; i < count; i += 2)
        memcpy(out + i, two, 2 * sizeof *out);
#endif
}

/* Copy eight numbers twice. */
static inline void simd16_duplicate(const float *eight, float *restrict out)
{
#if defined(__AVX512DQ__) /* written out because in pieces the next instruction would wait for the stores */
    _mm512_storeu_ps(out, _mm512_broadcast_f32x8(_mm256_loadu_ps(eight)));
#else
    memcpy(out, eight, 8 * sizeof *out);
    memcpy(out + 8, eight, 8 * sizeof *out);
#endif
}

/* Rows of masks processed at once: as many as have their two ends in one register. */
#if defined(__AVX512F__)
enum { SIMD16_ROWS = 8 };
#elif defined(__AVX2__)
enum { SIMD16_ROWS = 4 };
#else
enum { SIMD16_ROWS = 2 };
#endif

/* Draw one limb into rows of masks. The bits from the first to the second number of each pair (0 to 64) are
 * set in `whole`; those that were not set before are returned in `visible`. */
static inline void simd16_cover(const int32_t *span, uint64_t *restrict whole, uint64_t *restrict visible)
{
#if defined(__AVX512F__)
    __m512i const ones = _mm512_set1_epi64(-1), both = _mm512_loadu_si512(span);
    __m512i const from = _mm512_sllv_epi64(ones, _mm512_maskz_mov_epi32(0x5555, both));
    __m512i const to = _mm512_sllv_epi64(ones, _mm512_srli_epi64(both, 32));
    __m512i const nearer = _mm512_loadu_si512(whole);
    _mm512_storeu_si512(whole, _mm512_ternarylogic_epi64(nearer, from, to, 0xf4));
    _mm512_storeu_si512(visible, _mm512_ternarylogic_epi64(nearer, from, to, 0x04));
#elif defined(__AVX2__)
    __m256i const ones = _mm256_set1_epi64x(-1), both = _mm256_loadu_si256((const __m256i_u *)span);
    __m256i const from = _mm256_sllv_epi64(ones, _mm256_and_si256(both, _mm256_set1_epi64x(0xffffffff)));
    __m256i const mine = _mm256_andnot_si256(_mm256_sllv_epi64(ones, _mm256_srli_epi64(both, 32)), from);
    __m256i const nearer = _mm256_loadu_si256((const __m256i_u *)whole);
    _mm256_storeu_si256((__m256i_u *)whole, _mm256_or_si256(nearer, mine));
    _mm256_storeu_si256((__m256i_u *)visible, _mm256_andnot_si256(nearer, mine));
#else
    for (int32_t i = 0; i < SIMD16_ROWS; i++) {
        uint64_t const mine = grid_from[span[2 * i]] & ~grid_from[span[2 * i + 1]], nearer = whole[i];
        whole[i] = nearer | mine;
        visible[i] = mine & ~nearer;
    }
#endif
}

#ifdef SIMD4
/* Sixteen numbers of which each is multiplied with registers. */
#if defined(SIMD16_NEON)
#define SIMD4_NUMBERS(name, from)                                                                            \
    float32x4_t const name[4] = {vld1q_f32(from), vld1q_f32((from) + 4), vld1q_f32((from) + 8),              \
                                 vld1q_f32((from) + 12)}
#define SIMD4_NUMBER(name, k)   ((simd4_f)vdupq_laneq_f32(name[(k) / 4], (k) % 4))
#define SIMD4_TIMES(name, k, x) ((simd4_f)vmulq_laneq_f32((float32x4_t)(x), name[(k) / 4], (k) % 4))
#else
#define SIMD4_NUMBERS(name, from) const float *const name = (from)
#define SIMD4_NUMBER(name, k)     simd4_all(name[k])
#define SIMD4_TIMES(name, k, x)   (simd4_all(name[k]) * (x))
#endif

/* The second must be a number; of zeros of both signs, either. */
static inline simd4_f simd4_min(simd4_f a, simd4_f b)
{
#if defined(SIMD16_NEON)
    return (simd4_f)vminnmq_f32((float32x4_t)a, (float32x4_t)b);
#else
    return (simd4_f)_mm_min_ps((__m128)a, (__m128)b);
#endif
}
static inline simd4_f simd4_max(simd4_f a, simd4_f b)
{
#if defined(SIMD16_NEON)
    return (simd4_f)vmaxnmq_f32((float32x4_t)a, (float32x4_t)b);
#else
    return (simd4_f)_mm_max_ps((__m128)a, (__m128)b);
#endif
}

/* x where from <= y < to, elsewhere 0. */
static inline simd4_f simd4_inside(simd4_f y, simd4_f from, simd4_f to, simd4_f x)
{
    typedef int32_t words __attribute__((vector_size(16)));
    return (simd4_f)((words)x & (y >= from) & (y < to));
}

#if !defined(SIMD16_NEON)
static inline __m128i two_words(const uint64_t *a, const uint64_t *b)
{
    return _mm_set_epi64x((int64_t)*b, (int64_t)*a);
}
#endif

/* Draw one limb into four rows of masks. The bits from `from` up to `to` (numbers of at most 64, rounded towards 0;
 * less than 0 counts as 0) are set in `whole`; those that were not set before are returned in `visible`. */
static inline void simd4_cover(simd4_f from, simd4_f to, uint64_t *restrict whole, uint64_t *restrict visible)
{
#if defined(SIMD16_NEON)
    uint64x2_t const ones = vdupq_n_u64(~UINT64_C(0));
    uint32x4_t const left = vcvtq_u32_f32((float32x4_t)from), right = vcvtq_u32_f32((float32x4_t)to);
    uint64x2_t const low = vbicq_u64(vshlq_u64(ones, vreinterpretq_s64_u64(vmovl_u32(vget_low_u32(left)))),
                                     vshlq_u64(ones, vreinterpretq_s64_u64(vmovl_u32(vget_low_u32(right)))));
    uint64x2_t const high = vbicq_u64(vshlq_u64(ones, vreinterpretq_s64_u64(vmovl_high_u32(left))),
                                      vshlq_u64(ones, vreinterpretq_s64_u64(vmovl_high_u32(right))));
    uint64x2_t const low_nearer = vld1q_u64(whole), high_nearer = vld1q_u64(whole + 2);
    vst1q_u64(visible, vbicq_u64(low, low_nearer));
    vst1q_u64(visible + 2, vbicq_u64(high, high_nearer));
    vst1q_u64(whole, vorrq_u64(low_nearer, low));
    vst1q_u64(whole + 2, vorrq_u64(high_nearer, high));
#else
    __m128 const none = _mm_setzero_ps();
    int32_t left[4], right[4];
    _mm_storeu_si128((__m128i *)(void *)left, _mm_cvttps_epi32(_mm_max_ps((__m128)from, none)));
    _mm_storeu_si128((__m128i *)(void *)right, _mm_cvttps_epi32(_mm_max_ps((__m128)to, none)));
    SIMD16_STORED(left);
    SIMD16_STORED(right);
    for (int32_t i = 0; i < 4; i += 2) {
        __m128i const mine = _mm_andnot_si128(two_words(&grid_from[right[i]], &grid_from[right[i + 1]]),
                                              two_words(&grid_from[left[i]], &grid_from[left[i + 1]]));
        __m128i *const all = (__m128i *)(void *)(whole + i);
        __m128i const nearer = _mm_loadu_si128(all);
        _mm_storeu_si128(all, _mm_or_si128(nearer, mine));
        _mm_storeu_si128((__m128i *)(void *)(visible + i), _mm_andnot_si128(nearer, mine));
    }
#endif
}

#endif

/* Transpose sixteen numbers of sixteen bodies from in[number][body] to out[body][number], one cache line
 * each. */
static inline void simd16_transpose(const float (*restrict in)[SIMD16], float (*restrict out)[SIMD16])
{
#if defined(__AVX2__)
    for (int32_t a = 0; a < SIMD16; a += 8)
        for (int32_t b = 0; b < SIMD16; b += 8) {
            __m256 r[8], s[8];
#pragma GCC unroll 8
            for (int32_t i = 0; i < 8; i++) /* four numbers of each half of the bodies in each */
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
#elif defined(SIMD16_SSE2) || defined(SIMD16_NEON)
    for (int32_t a = 0; a < SIMD16; a += 4)
        for (int32_t b = 0; b < SIMD16; b += 4) {
#if defined(SIMD16_SSE2)
            __m128 r0 = _mm_loadu_ps(in[a] + b), r1 = _mm_loadu_ps(in[a + 1] + b);
            __m128 r2 = _mm_loadu_ps(in[a + 2] + b), r3 = _mm_loadu_ps(in[a + 3] + b);
            _MM_TRANSPOSE4_PS(r0, r1, r2, r3);
            _mm_storeu_ps(out[b] + a, r0);
            _mm_storeu_ps(out[b + 1] + a, r1);
            _mm_storeu_ps(out[b + 2] + a, r2);
            _mm_storeu_ps(out[b + 3] + a, r3);
#else
            float32x4x2_t const r02 = vzipq_f32(vld1q_f32(in[a] + b), vld1q_f32(in[a + 2] + b));
            float32x4x2_t const r13 = vzipq_f32(vld1q_f32(in[a + 1] + b), vld1q_f32(in[a + 3] + b));
            float32x4x2_t const low = vzipq_f32(r02.val[0], r13.val[0]),
                                high = vzipq_f32(r02.val[1], r13.val[1]);
            vst1q_f32(out[b] + a, low.val[0]);
            vst1q_f32(out[b + 1] + a, low.val[1]);
            vst1q_f32(out[b + 2] + a, high.val[0]);
            vst1q_f32(out[b + 3] + a, high.val[1]);
#endif
        }
#else
    for (int32_t b = 0; b < SIMD16; b++)
        for (int32_t a = 0; a < SIMD16; a++)
            out[b][a] = in[a][b];
#endif
}
#endif
