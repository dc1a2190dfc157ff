/* like_hide.h - which points of a limb its own mask shows: what is nearer hides the others.  For kernels. */
#ifndef GAIT_LIKE_HIDE_H
#define GAIT_LIKE_HIDE_H
#include "lanes.h"
#include "rast.h"

/* The bits of the halves of the mask's words that hold columns x, from the mask's first on, in rows y. */
static inline void mask_halves(const rast_mask *mask, const int32_t *x, const int32_t *y, const int32_t *take,
                               int32_t *restrict bits)
{
    int32_t at[LANES];
#if defined(LANES_TABLE)
    int32_t const from = mask->first & ~7; /* where a line of the cache begins */
    if (mask->width == 64 && mask->last - from <= LANES_TABLE / 2) {
        for (int32_t i = 0; i < LANES; i++)
            at[i] = ((y[i] - from) << 1) + (x[i] >> 5);
        lookup_table(mask->word[0] + from, at, bits);
        return;
    }
#endif
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++)
        at[i] = rast_half(x[i], y[i]);
    lookup(mask->word, at, take, bits);
}

/* Of the cells that are shown (negative), at 2^shift x and y, those in a mask remain so. */
static inline void hide(const rast_mask *mask, const int32_t *x, const int32_t *y, int32_t shift,
                        int32_t *restrict shown)
{
    int32_t column[LANES], row[LANES], bits[LANES];
    uint32_t const width = (uint32_t)mask->width, rows = (uint32_t)(mask->last - mask->first);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++) {
        column[i] = (x[i] >> shift) - mask->column;
        row[i] = y[i] >> shift;
        shown[i] &= -(((uint32_t)column[i] < width) & ((uint32_t)(row[i] - mask->first) < rows));
    }
    mask_halves(mask, column, row, shown, bits);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++)
        shown[i] &= (int32_t)((uint32_t)bits[i] << (~column[i] & 31));
}
#endif
