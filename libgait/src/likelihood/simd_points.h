/* simd_points.h - sixteen points of a limb in registers of four numbers or sixteen bytes: SSE4 and NEON. */
#ifndef GAIT_LIKELIHOOD_SIMD_POINTS_H
#define GAIT_LIKELIHOOD_SIMD_POINTS_H
#include "base/simd16.h"
#include "model/model.h"

#ifdef SIMD4
typedef int32_t simd4_i __attribute__((vector_size(16)));
typedef uint32_t simd4_u __attribute__((vector_size(16)));
typedef uint8_t simd16_bytes __attribute__((vector_size(16))); /* of a condition: all bits or none */

/* Four parts of sixteen points: x86 has too few registers for all. */
#if defined(SIMD16_NEON)
enum { SIMD4_UNROLL = 4 };
#else
enum { SIMD4_UNROLL = 1 };
#endif

/* Rounded towards 0; of a number that is too large for int32_t, some integer. */
static inline simd4_i simd4_whole(simd4_f x)
{
#if defined(SIMD16_NEON)
    return (simd4_i)vcvtq_s32_f32((float32x4_t)x);
#else
    return (simd4_i)_mm_cvttps_epi32((__m128)x);
#endif
}

static inline simd4_u simd4_greater(simd4_u a, simd4_u b)
{
#if defined(SIMD16_NEON)
    return (simd4_u)vmaxq_u32((uint32x4_t)a, (uint32x4_t)b);
#else
    return (simd4_u)_mm_max_epu32((__m128i)a, (__m128i)b);
#endif
}

static inline simd16_bytes simd16_all(int32_t x)
{
#if defined(SIMD16_NEON)
    return (simd16_bytes)vdupq_n_u8((uint8_t)x);
#else
    return (simd16_bytes)_mm_set1_epi8((char)x);
#endif
}

/* Sixteen conditions. */
static inline simd16_bytes simd16_conditions(const simd4_i v[4])
{
#if defined(SIMD16_NEON)
    uint16x8_t const low = vuzp1q_u16((uint16x8_t)v[0], (uint16x8_t)v[1]);
    return (simd16_bytes)vuzp1q_u8((uint8x16_t)low,
                                   (uint8x16_t)vuzp1q_u16((uint16x8_t)v[2], (uint16x8_t)v[3]));
#else
    return (simd16_bytes)_mm_packs_epi16(_mm_packs_epi32((__m128i)v[0], (__m128i)v[1]),
                                         _mm_packs_epi32((__m128i)v[2], (__m128i)v[3]));
#endif
}

/* Two numbers, each twice. */
static inline simd4_f simd4_twice(const float *two)
{
    double both;
    memcpy(&both, two, sizeof both);
#if defined(SIMD16_NEON)
    return (simd4_f)vdupq_n_f64(both);
#else
    return (simd4_f)_mm_set1_pd(both);
#endif
}

/* Numbers of 0 to 255; of others, some. */
static inline simd16_bytes simd16_low(const simd4_i v[4])
{
#if defined(SIMD16_NEON)
    return simd16_conditions(v);
#else
    return (simd16_bytes)_mm_packus_epi16(_mm_packus_epi32((__m128i)v[0], (__m128i)v[1]),
                                          _mm_packus_epi32((__m128i)v[2], (__m128i)v[3]));
#endif
}

/* Numbers of 0 to 65535 as whole and fraction in 1/256; of others, some. */
static inline void simd16_split(const simd4_i v[4], simd16_bytes *whole, simd16_bytes *fraction)
{
#if defined(SIMD16_NEON)
    uint8x16_t const low = (uint8x16_t)vuzp1q_u16((uint16x8_t)v[0], (uint16x8_t)v[1]);
    uint8x16_t const high = (uint8x16_t)vuzp1q_u16((uint16x8_t)v[2], (uint16x8_t)v[3]);
    *whole = (simd16_bytes)vuzp2q_u8(low, high);
    *fraction = (simd16_bytes)vuzp1q_u8(low, high);
#else
    __m128i const byte = _mm_set1_epi16(255), low = _mm_packus_epi32((__m128i)v[0], (__m128i)v[1]),
                  high = _mm_packus_epi32((__m128i)v[2], (__m128i)v[3]);
    *whole = (simd16_bytes)_mm_packus_epi16(_mm_srli_epi16(low, 8), _mm_srli_epi16(high, 8));
    *fraction = (simd16_bytes)_mm_packus_epi16(_mm_and_si128(low, byte), _mm_and_si128(high, byte));
#endif
}

/* v[i] - from, of 0 to 127; at least 128 where it is not in this range. */
static inline simd16_bytes simd16_from(const simd4_i v[4], int32_t from)
{
#if defined(SIMD16_NEON)
    int16x8_t const off = vdupq_n_s16((int16_t)from);
    int16x8_t const low = vqmovn_high_s32(vqmovn_s32((int32x4_t)v[0]), (int32x4_t)v[1]);
    int16x8_t const high = vqmovn_high_s32(vqmovn_s32((int32x4_t)v[2]), (int32x4_t)v[3]);
    return (simd16_bytes)vqmovn_high_u16(vqmovn_u16((uint16x8_t)vqsubq_s16(low, off)),
                                         (uint16x8_t)vqsubq_s16(high, off));
#else
    __m128i const off =
        _mm_set1_epi16((int16_t)(from + 64)); /* saturated numbers are then from 127 + 64 on */
    __m128i const low = _mm_packs_epi32((__m128i)v[0], (__m128i)v[1]);
    __m128i const high = _mm_packs_epi32((__m128i)v[2], (__m128i)v[3]);
    return (simd16_bytes)_mm_packs_epi16(_mm_subs_epi16(low, off), _mm_subs_epi16(high, off)) +
           simd16_all(64);
#endif
}

/* ---- look-ups; of all limbs before the first result is used: a load of several words waits for their stores ---- */

typedef struct simd16_cells { /* cells of a limb's points, relative to the first row and column of its mask */
    simd16_bytes row, column; /* 128 and more are outside */
    simd16_bytes on;          /* condition: the point counts */
} simd16_cells;

#if defined(SIMD16_NEON)
/* Let only points count whose cell is in the mask, of which eight rows are a table of bytes. */
static inline void simd16_keep(const grid_mask *mask, simd16_cells *p)
{
    int32_t const rows = mask->last - mask->first;
    uint8x16_t const bit = vshlq_u8(vdupq_n_u8(1), (int8x16_t)(p->column & simd16_all(7)));
    uint8x16_t found = vdupq_n_u8(0);
    for (int32_t w = 0; 64 * w < mask->width; w++) {
        const uint8_t *const bytes = (const uint8_t *)(mask->word[w] + mask->first);
        uint8x16_t const across = (uint8x16_t)(p->column - simd16_all(64 * w));
        uint8x16_t const byte = vorrq_u8(vshrq_n_u8(across, 3), vcgtq_u8(across, vdupq_n_u8(63)));
        uint8x16_t down = (uint8x16_t)p->row;
        for (int32_t y = 0; y < rows; y += 8) {
            found = vqtbx4q_u8(found, vld1q_u8_x4(bytes + 8 * y), vorrq_u8(vqshlq_n_u8(down, 3), byte));
            down = vsubq_u8(down, vdupq_n_u8(8));
        }
    }
    p->on &= (simd16_bytes)(p->row < simd16_all(rows)) & (simd16_bytes)vtstq_u8(found, bit);
}
#else
/* Let only points count that are in the frame of the mask; at[i]: the byte of the mask that has the cell. */
static inline void simd16_frame(const grid_mask *mask, simd16_cells *p, uint16_t *at)
{
    simd16_bytes const in = p->on & (simd16_bytes)(p->row < simd16_all(mask->last - mask->first)) &
                            (simd16_bytes)(p->column < simd16_all(mask->width));
    __m128i const row = (__m128i)(p->row & in), column = (__m128i)(p->column & in);
    __m128i const byte = _mm_and_si128(_mm_srli_epi16(column, 3), _mm_set1_epi8(15));
    __m128i const by = _mm_set1_epi16(0x0108); /* 8 row + column / 8 */
    __m128i low = _mm_maddubs_epi16(_mm_unpacklo_epi8(row, byte), by);
    __m128i high = _mm_maddubs_epi16(_mm_unpackhi_epi8(row, byte), by);
    if (mask->width > 64) { /* the second word is elsewhere */
        __m128i const second = _mm_cmpgt_epi8(column, _mm_set1_epi8(63));
        __m128i const apart = _mm_set1_epi16(8 * (GRID_SIZE + GRID_SPARE) - 8);
        low = _mm_add_epi16(low, _mm_and_si128(_mm_unpacklo_epi8(second, second), apart));
        high = _mm_add_epi16(high, _mm_and_si128(_mm_unpackhi_epi8(second, second), apart));
    }
    p->on = in;
    _mm_storeu_si128((__m128i *)(void *)at, low);
    _mm_storeu_si128((__m128i *)(void *)(at + 8), high);
}

/* Let only points count whose bit of these is set. */
static inline void simd16_show(const uint8_t *bits, simd16_cells *p)
{
    __m128i const powers = _mm_set1_epi64x((int64_t)0x8040201008040201);
    __m128i const bit = _mm_shuffle_epi8(powers, (__m128i)(p->column & simd16_all(7)));
    __m128i const found = _mm_and_si128(_mm_loadu_si128((const __m128i *)(const void *)bits), bit);
    p->on &= (simd16_bytes)_mm_cmpeq_epi8(found, bit);
}
#endif

/* Let only points count whose cell is in the mask of their limb. */
static inline void simd16_covered(const grid_mask *mask, int32_t limbs, simd16_cells *p)
{
#if defined(SIMD16_NEON)
    for (int32_t l = 0; l < limbs; l++)
        simd16_keep(&mask[l], &p[l]);
#else
    uint16_t at[MODEL_MAX_LIMBS][SIMD16];
    uint8_t bits[MODEL_MAX_LIMBS][SIMD16];
    for (int32_t l = 0; l < limbs; l++)
        simd16_frame(&mask[l], &p[l], at[l]);
    for (int32_t l = 0; l < limbs; l++) {
        const uint8_t *const bytes = (const uint8_t *)(mask[l].word[0] + mask[l].first);
#pragma GCC unroll 4
        for (int32_t i = 0; i < SIMD16; i++)
            bits[l][i] = (uint8_t)simd16_single(bytes[at[l][i]]);
    }
    for (int32_t l = 0; l < limbs; l++)
        simd16_show(bits[l], &p[l]);
#endif
}

/* Words of four bytes at row y, column x of a table of 256 columns of `bytes` (2 or 4) each. */
static inline void simd16_words_at(const void *table, int32_t bytes, simd16_bytes y, simd16_bytes x,
                                   uint32_t *restrict word)
{
#if defined(SIMD16_NEON)
    uint16x8_t const low = (uint16x8_t)vzip1q_u8((uint8x16_t)x, (uint8x16_t)y),
                     high = (uint16x8_t)vzip2q_u8((uint8x16_t)x, (uint8x16_t)y);
    size_t const scale =
        bytes == 2 ? 1 : 4; /* of an index in pairs or in words, with which a load multiplies */
    simd4_u const at[4] = {
        (simd4_u)(bytes == 2 ? vshll_n_u16(vget_low_u16(low), 1) : vmovl_u16(vget_low_u16(low))),
        (simd4_u)(bytes == 2 ? vshll_high_n_u16(low, 1) : vmovl_high_u16(low)),
        (simd4_u)(bytes == 2 ? vshll_n_u16(vget_low_u16(high), 1) : vmovl_u16(vget_low_u16(high))),
        (simd4_u)(bytes == 2 ? vshll_high_n_u16(high, 1) : vmovl_high_u16(high))};
#pragma GCC unroll 4
    for (int32_t i = 0; i < 4; i++) {
        uint32_t four[4];
#pragma GCC unroll 4
        for (int32_t k = 0; k < 4; k++)
            memcpy(&four[k], (const char *)table + scale * at[i][k], sizeof four[k]);
        simd4_u const all = {four[0], four[1], four[2], four[3]};
        memcpy(word + 4 * i, &all, sizeof all);
    }
#else
    uint16_t at[SIMD16];
    _mm_storeu_si128((__m128i *)(void *)at, _mm_unpacklo_epi8((__m128i)x, (__m128i)y));
    _mm_storeu_si128((__m128i *)(void *)(at + 8), _mm_unpackhi_epi8((__m128i)x, (__m128i)y));
    SIMD16_STORED(at);
#pragma GCC unroll 4
    for (int32_t i = 0; i < SIMD16; i++) {
        uint32_t found;
        memcpy(&found, (const char *)table + (size_t)bytes * at[i], sizeof found);
        word[i] = simd16_single(found);
    }
#endif
}

/* Bilinear interpolation between the four bytes of a word (left, left below, right, right below), with fractions in
 * 1/256; rounded towards 0. */
static inline simd16_bytes simd16_between(const uint32_t *word, simd16_bytes across, simd16_bytes down)
{
    simd4_u four[4];
    memcpy(four, word, sizeof four);
#if defined(SIMD16_NEON)
    uint8x16_t const low = (uint8x16_t)four[0], high = (uint8x16_t)four[1], low2 = (uint8x16_t)four[2],
                     high2 = (uint8x16_t)four[3];
    uint8x16_t const above = vuzp1q_u8(low, high), below = vuzp2q_u8(low, high),
                     above2 = vuzp1q_u8(low2, high2), below2 = vuzp2q_u8(low2, high2);
    int8x16_t const edge[2][2] = {{(int8x16_t)vuzp1q_u8(above, above2), (int8x16_t)vuzp2q_u8(above, above2)},
                                  {(int8x16_t)vuzp1q_u8(below, below2), (int8x16_t)vuzp2q_u8(below, below2)}};
    int16x8_t const fx[2] = {(int16x8_t)vmovl_u8(vget_low_u8((uint8x16_t)across)),
                             (int16x8_t)vmovl_high_u8((uint8x16_t)across)};
    int16x8_t const fy[2] = {(int16x8_t)vmovl_u8(vget_low_u8((uint8x16_t)down)),
                             (int16x8_t)vmovl_high_u8((uint8x16_t)down)};
    int16x8_t row[2][2]; /* [top, bottom][half] */
    for (int32_t r = 0; r < 2; r++) {
        int8x16_t const left = edge[r][0], right = edge[r][1];
        row[r][0] = vmlaq_s16(vshll_n_s8(vget_low_s8(left), 8),
                              vsubl_s8(vget_low_s8(right), vget_low_s8(left)), fx[0]);
        row[r][1] = vmlaq_s16(vshll_high_n_s8(left, 8), vsubl_high_s8(right, left), fx[1]);
    }
    int16x8_t whole[2];
    for (int32_t h = 0; h < 2; h++) {
        int16x8_t const top = row[0][h], bottom = row[1][h], f = fy[h];
        int32x4_t a = vmlal_s16(vshll_n_s16(vget_low_s16(top), 8), vget_low_s16(bottom), vget_low_s16(f));
        int32x4_t b = vmlal_high_s16(vshll_high_n_s16(top, 8), bottom, f);
        a = vmlsl_s16(a, vget_low_s16(top), vget_low_s16(f));
        b = vmlsl_high_s16(b, top, f);
        a = (int32x4_t)vsraq_n_u32((uint32x4_t)a, (uint32x4_t)vshrq_n_s32(a, 31), 16);
        b = (int32x4_t)vsraq_n_u32((uint32x4_t)b, (uint32x4_t)vshrq_n_s32(b, 31), 16);
        whole[h] = vuzp2q_s16((int16x8_t)a, (int16x8_t)b);
    }
    return (simd16_bytes)vuzp1q_u8((uint8x16_t)whole[0], (uint8x16_t)whole[1]);
#else
    __m128i const bytes = _mm_setr_epi8(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    __m128i const words = _mm_or_si128(bytes, _mm_set1_epi16((short)0x8000));
    __m128i value[4];
#pragma GCC unroll 4
    for (int32_t i = 0; i < 4; i++) {
        __m128i const w = (__m128i)four[i], next = _mm_set1_epi8((char)(4 * i));
        __m128i const fy = _mm_shuffle_epi8((__m128i)down, _mm_add_epi8(bytes, next));
        __m128i const left = _mm_srai_epi16(_mm_slli_epi16(w, 8), 8);
        __m128i const both =
            _mm_add_epi16(_mm_maddubs_epi16(_mm_xor_si128(fy, _mm_set1_epi16(0x00ff)), w), left);
        __m128i const fx = _mm_shuffle_epi8((__m128i)across, _mm_add_epi8(words, next));
        __m128i const shares = _mm_add_epi16(_mm_xor_si128(fx, _mm_set1_epi32(0xffff)), _mm_set1_epi32(257));
        __m128i const sum = _mm_madd_epi16(both, shares);
        __m128i const up = _mm_srli_epi32(_mm_srai_epi32(sum, 31), 16);
        value[i] = _mm_srai_epi32(_mm_add_epi32(sum, up), 16);
    }
    return (simd16_bytes)_mm_packs_epi16(_mm_packs_epi32(value[0], value[1]),
                                         _mm_packs_epi32(value[2], value[3]));
#endif
}

/* Sums over points of bytes 0 of words, and of byte 1 times the low half of a pair plus byte 3 times its high half; the
 * number of points. */
typedef struct simd16_tally {
#if defined(SIMD16_NEON)
    uint16x8_t low;
    int32x4_t dot;
#else
    __m128i low, dot;
#endif
    simd16_bytes count;
} simd16_tally;

static inline simd16_tally simd16_tally_none(void)
{
    simd16_tally t;
    memset(&t, 0, sizeof t);
    return t;
}

/* Add sixteen points where a condition holds, at most 128 times. pair[i & 1] is that of words [i]; its halves are -64 to
 * 64. */
static inline void simd16_tally_add(simd16_tally *t, const uint32_t *words, const simd4_i pair[2],
                                    simd16_bytes on)
{
    simd4_u word[4];
    memcpy(word, words, sizeof word);
    t->count -= on;
#if defined(SIMD16_NEON)
    uint8x16_t const a = (uint8x16_t)word[0], b = (uint8x16_t)word[1], c = (uint8x16_t)word[2],
                     d = (uint8x16_t)word[3], take = (uint8x16_t)on;
    uint8x16_t const high = vuzp2q_u8(a, b), high2 = vuzp2q_u8(c, d);
    uint8x16_t const low = vuzp1q_u8(vuzp1q_u8(a, b), vuzp1q_u8(c, d));
    uint8x16_t const x = vuzp1q_u8(high, high2), y = vuzp2q_u8(high, high2);
    uint8x16_t const halves = vuzp1q_u8((uint8x16_t)pair[0], (uint8x16_t)pair[1]); /* low bytes of both */
    int8x16_t const cos = (int8x16_t)vandq_u8(vuzp1q_u8(halves, halves), take),
                    sin = (int8x16_t)vandq_u8(vuzp2q_u8(halves, halves), take);
    t->low = vpadalq_u8(t->low, vandq_u8(low, take));
    t->dot = vpadalq_s16(t->dot, vmlal_s8(vmull_s8(vget_low_s8((int8x16_t)x), vget_low_s8(cos)),
                                          vget_low_s8((int8x16_t)y), vget_low_s8(sin)));
    t->dot = vpadalq_s16(t->dot, vmlal_high_s8(vmull_high_s8((int8x16_t)x, cos), (int8x16_t)y, sin));
#else
    __m128i take = (__m128i)on;
#pragma GCC unroll 4
    for (int32_t i = 0; i < 4; i++) {
        __m128i const w = _mm_and_si128((__m128i)word[i], _mm_cvtepi8_epi32(take));
        take = _mm_srli_si128(take, 4);
        t->low = _mm_add_epi32(t->low, _mm_and_si128(w, _mm_set1_epi32(255)));
        t->dot = _mm_add_epi32(t->dot, _mm_madd_epi16(_mm_srai_epi16(w, 8), (__m128i)pair[i & 1]));
    }
#endif
}

static inline simd16_sums simd16_tally_sums(const simd16_tally *t)
{
#if defined(SIMD16_NEON)
    return (simd16_sums){(int32_t)vaddlvq_u16(t->low), vaddvq_s32(t->dot), vaddlvq_u8((uint8x16_t)t->count)};
#else
    __m128i const count = _mm_sad_epu8((__m128i)t->count, _mm_setzero_si128());
    __m128i sum = _mm_hadd_epi32(t->low, t->dot);
    sum = _mm_hadd_epi32(sum, count); /* of low, of dot; of the two halves of count */
    return (simd16_sums){_mm_cvtsi128_si32(sum), _mm_extract_epi32(sum, 1),
                         _mm_extract_epi32(sum, 2) + _mm_extract_epi32(sum, 3)};
#endif
}
#endif
#endif
