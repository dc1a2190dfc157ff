/* visible.h - for kernels: which points of a limb are visible, that is in the limb's own mask, from which
 * the cells that nearer limbs hide were removed. */
#ifndef GAIT_LIKELIHOOD_VISIBLE_H
#define GAIT_LIKELIHOOD_VISIBLE_H
#include "base/dispatch.h"
#include "base/simd16.h"
#include "base/grid_mask.h"
#include "model/model.h"

#if defined(__AVX512F__)
#define HIDE_ANY                                                                                             \
    KERNEL_ROW /* rarely used, since most masks are small: inlining it would only cost registers */
#else
#define HIDE_ANY static inline
#endif

HIDE_ANY void hide_any(const grid_mask *mask, const int32_t *x, const int32_t *y, int32_t shift,
                       int32_t *restrict shown)
{
    int32_t column[SIMD16], at[SIMD16], bits[SIMD16], set[SIMD16];
    uint32_t const width = (uint32_t)mask->width, rows = (uint32_t)(mask->last - mask->first);
#pragma GCC unroll 1
    for (int32_t i = 0; i < SIMD16; i++) {
        int32_t const row = y[i] >> shift;
        column[i] = (x[i] >> shift) - mask->column;
        shown[i] &= -(((uint32_t)column[i] < width) & ((uint32_t)(row - mask->first) < rows));
        at[i] = grid_half(column[i], row) & shown[i] >> 31;
    }
    simd16_lookup(mask->word, at, shown, SIMD16, bits);
    simd16_bit(bits, column, set);
#pragma GCC unroll 1
    for (int32_t i = 0; i < SIMD16; i++)
        shown[i] &= set[i];
}

#if defined(__AVX512F__)
/* Two rows of half words in each register. Columns count down from the last one, which comes first in a
 * word. */
static inline void hide_small(const grid_mask *mask, const int32_t *x, const int32_t *y, int32_t shift,
                              int32_t *restrict shown)
{
    const __m512i *const t = (const __m512i *)(const void *)(mask->word[0] + mask->first);
    __m512i const column = _mm512_srai_epi32(_mm512_loadu_si512(x), (unsigned)shift);
    __m512i const row = _mm512_srai_epi32(_mm512_loadu_si512(y), (unsigned)shift);
    __m512i const back = _mm512_sub_epi32(_mm512_set1_epi32(mask->edge), column);
    __m512i const above = _mm512_sub_epi32(_mm512_slli_epi32(row, 1), _mm512_set1_epi32(mask->half));
    __m512i const at = _mm512_sub_epi32(above, _mm512_srli_epi32(back, 5));
    __mmask16 const across = _mm512_cmplt_epu32_mask(back, _mm512_set1_epi32(mask->width));
    __mmask16 const in = _mm512_mask_cmplt_epu32_mask(across, at, _mm512_set1_epi32(mask->halves));
    __mmask16 const beyond = _mm512_test_epi32_mask(at, _mm512_set1_epi32(GRID_SMALL));
    __m512i const low = _mm512_permutex2var_epi32(_mm512_load_si512(t), at, _mm512_load_si512(t + 1));
    __m512i const high = _mm512_permutex2var_epi32(_mm512_load_si512(t + 2), at, _mm512_load_si512(t + 3));
    __m512i const bits = _mm512_rolv_epi32(_mm512_mask_blend_epi32(beyond, low, high), back);
    _mm512_storeu_si512(shown, _mm512_maskz_and_epi32(in, bits, _mm512_loadu_si512(shown)));
}
#endif

/* Points are shown where `shown` is negative. Those of each limb at (x, y) in units of 2^-shift cells stay shown only
 * where their cell is in the limb's mask. */
static inline void hide(const grid_mask *mask, int32_t limbs, const int32_t (*x)[SIMD16],
                        const int32_t (*y)[SIMD16], int32_t shift, int32_t (*restrict shown)[SIMD16])
{
    for (int32_t l = 0; l < limbs; l++)
#if defined(__AVX512F__)
        if (mask[l].small)
            hide_small(&mask[l], x[l], y[l], shift, shown[l]);
        else
#endif
            hide_any(&mask[l], x[l], y[l], shift, shown[l]);
}
#endif
