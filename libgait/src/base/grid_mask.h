/* grid_mask.h - bit masks of the small grid on which bodies are drawn and foreground is counted. */
#ifndef GAIT_BASE_GRID_MASK_H
#define GAIT_BASE_GRID_MASK_H
#include "base/base.h"

enum {
    GRID_SIZE = 128, /* the grid is GRID_SIZE x GRID_SIZE cells */
    GRID_WORDS = 2,  /* 64-bit words per row of the grid */
    GRID_SPARE = 16, /* rows of a mask beyond the grid: may be written, never read */
    GRID_SMALL = 32, /* most rows of 64 columns that fit in registers */
    GRID_STEP = 8,   /* a word can begin at any multiple of this many columns */
    GRID_STARTS = 64 / GRID_STEP + 1
};

/* Rows [first, last) and `width` columns from `column`, a multiple of GRID_STEP. Everything else is empty
 * and not stored. */
typedef struct grid_mask {
    _Alignas(
        GAIT_ALIGN) uint64_t word[GRID_WORDS][GRID_SIZE + GRID_SPARE]; /* from column, and from column + 64 */
    int32_t first, last, column, width; /* width: 64, or 128 from column 0 on */
    int32_t edge, half, halves; /* for lookups: the last of 64 columns; 2 first - 1; 2 (last - first) */
    bool small; /* 64 columns and at most GRID_SMALL rows, the first of which begins a cache line */
} grid_mask;

/* Set the rows and columns of a mask and the values derived from them. */
static inline void grid_mask_frame(grid_mask *m, int32_t first, int32_t last, int32_t column, int32_t width)
{
    m->first = first;
    m->last = last;
    m->column = column;
    m->width = width;
    m->edge = column + 63;
    m->half = 2 * first - 1;
    m->halves = 2 * (last - first);
    m->small = (width == 64) & (last - first <= GRID_SMALL) & (first % 8 == 0);
}

/* grid_from[k]: bits k and above of a word, none for 64. Bits [begin, end) are grid_from[begin] &
 * ~grid_from[end], none if begin >= end. */
extern const uint64_t grid_from[65];

/* Index of the 32-bit half word of a mask that has the cell x columns right of the first column in row y. */
static inline int32_t grid_half(int32_t x, int32_t y)
{
    return 2 * y + (x >> 5) + (x < 64 ? 0 : 2 * (GRID_SIZE + GRID_SPARE) - 2);
}

/* Number of set bits, without a table or an ISA extension. */
static inline int32_t grid_popcount(uint64_t v)
{
    v = v - ((v >> 1) & UINT64_C(0x5555555555555555));
    v = (v & UINT64_C(0x3333333333333333)) + ((v >> 2) & UINT64_C(0x3333333333333333));
    v = (v + (v >> 4)) & UINT64_C(0x0f0f0f0f0f0f0f0f);
    return (int32_t)((v * UINT64_C(0x0101010101010101)) >> 56);
}
#endif
