/* rast.h - scan conversion of convex polygons to exact row spans, and bit masks of a small grid (drawn by layers.h).
 *
 * A span's coverage is decided in integers (vertices at 1/256 of a pixel): a pixel belongs to a polygon if its centre
 * does, left and top edges included, so two polygons that share an edge never cover a pixel twice. */
#ifndef GAIT_RAST_H
#define GAIT_RAST_H
#include "base.h"

enum {
    RAST_SIZE = 128, /* the grid is RAST_SIZE x RAST_SIZE cells */
    RAST_WORDS = 2,  /* 64-bit words per row of the grid */
    RAST_SPARE = 16, /* rows of a mask beyond the grid: written in passing, never read */
    RAST_SMALL = 32, /* rows of 64 columns that are looked up in registers */
    RAST_STEP = 8,   /* a word can begin at any multiple of this many columns */
    RAST_STARTS = 64 / RAST_STEP + 1,
    RAST_MAX_VERTICES = 8,
    RAST_LIMIT = 16000 /* coordinates are clamped to +-this many pixels */
};

typedef struct rast_spans { /* rows first <= y < last; each covers begin[y - top] <= x < end[y - top] */
    int32_t first, last;    /* (begin >= end: none) */
    int16_t begin[RAST_SIZE], end[RAST_SIZE];
} rast_spans;

/* Rows [first, last) and columns from `column` on, a multiple of RAST_STEP; the rest is empty and not written. */
typedef struct rast_mask {
    _Alignas(
        GAIT_ALIGN) uint64_t word[RAST_WORDS][RAST_SIZE + RAST_SPARE]; /* from column, and from column + 64 */
    int32_t first, last, column, width; /* width: 64, or 128 from column 0 on */
    /* For look-ups: the last of 64 columns, twice `first` less one, twice the rows; small: 64 columns and at most
     * RAST_SMALL rows, of which the first begins a line of the cache. */
    int32_t edge, half, halves;
    bool small;
} rast_mask;

/* What a mask holds, and what follows from it. */
static inline void rast_frame(rast_mask *m, int32_t first, int32_t last, int32_t column, int32_t width)
{
    m->first = first;
    m->last = last;
    m->column = column;
    m->width = width;
    m->edge = column + 63;
    m->half = 2 * first - 1;
    m->halves = 2 * (last - first);
    m->small = (width == 64) & (last - first <= RAST_SMALL) & (first % 8 == 0);
}

/* Spans of a convex polygon of n vertices in the window of RAST_SIZE rows from top and width columns from
 * 0. */
void rast_convex(const float *x, const float *y, int32_t n, int32_t top, int32_t width, rast_spans *out);

/* Bits [begin, end) of a word, begin >= 0, end <= 64; begin >= end: none.  No branch: a loop becomes vector code. */
static inline uint64_t rast_bits(int32_t begin, int32_t end)
{
    uint64_t const ones = (uint64_t)(int64_t)-(int32_t)(begin < end);
    return (ones >> ((uint32_t)(begin - end) & 63u)) << ((uint32_t)begin & 63u);
}

/* Which of the 32-bit halves of a mask's words holds the cell x columns right of the mask's first in row y. */
static inline int32_t rast_half(int32_t x, int32_t y)
{
    return 2 * y + (x >> 5) + (x < 64 ? 0 : 2 * (RAST_SIZE + RAST_SPARE) - 2);
}

/* Number of set bits, without a table or an ISA extension. */
static inline int32_t rast_popcount(uint64_t v)
{
    v = v - ((v >> 1) & UINT64_C(0x5555555555555555));
    v = (v & UINT64_C(0x3333333333333333)) + ((v >> 2) & UINT64_C(0x3333333333333333));
    v = (v + (v >> 4)) & UINT64_C(0x0f0f0f0f0f0f0f0f);
    return (int32_t)((v * UINT64_C(0x0101010101010101)) >> 56);
}
#endif
