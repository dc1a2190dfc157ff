/* rast.h - scan conversion of convex polygons to exact row spans and to bit masks of a small grid.
 *
 * Coverage is decided in integers (1/256 of a pixel): a pixel belongs to a polygon if its centre does,
 * left and top edges included, so two polygons that share an edge never cover a pixel twice. */
#ifndef GAIT_RAST_H
#define GAIT_RAST_H
#include <stdint.h>

enum {
    RAST_SIZE = 128, /* the grid is RAST_SIZE x RAST_SIZE cells */
    RAST_WORDS = 2,  /* 64-bit words per row of the grid */
    RAST_MAX_VERTICES = 8,
    RAST_LIMIT = 16000 /* coordinates are clamped to +-this many pixels */
};

typedef struct rast_spans { /* rows first <= y < last; each covers begin[y - top] <= x < end[y - top] */
    int32_t first, last;
    int16_t begin[RAST_SIZE], end[RAST_SIZE];
} rast_spans;

typedef struct rast_mask { /* bit x of row y; rows outside [first, last) are not written */
    int32_t first, last;
    uint64_t row[RAST_SIZE][RAST_WORDS];
} rast_mask;

/* Spans of a convex polygon of n vertices in the window of RAST_SIZE rows from top and width columns from
 * 0. */
void rast_convex(const float *x, const float *y, int32_t n, int32_t top, int32_t width, rast_spans *out);

/* The spans as bits; width must have been RAST_SIZE and top 0. */
void rast_fill(const rast_spans *spans, rast_mask *out);

/* Number of set bits, without a table or an ISA extension. */
static inline int32_t rast_popcount(uint64_t v)
{
    v = v - ((v >> 1) & UINT64_C(0x5555555555555555));
    v = (v & UINT64_C(0x3333333333333333)) + ((v >> 2) & UINT64_C(0x3333333333333333));
    v = (v + (v >> 4)) & UINT64_C(0x0f0f0f0f0f0f0f0f);
    return (int32_t)((v * UINT64_C(0x0101010101010101)) >> 56);
}
#endif
