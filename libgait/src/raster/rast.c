#include "raster/rast.h"

enum { SUB = 256 }; /* sub-pixel steps */

typedef struct edge { /* crosses rows first <= y < last */
    int32_t first, last;
    uint32_t at, slope; /* column at row 0, 1/65536 pixel, modulo 2^32; offset so that the shift rounds up */
} edge;

/* Nearest integer, ties away from 0; clamped to +-limit, NaN to -limit. */
static int32_t nearest(float v, float limit)
{
    float const c = f_clamp(v, -limit, limit);
    return (int32_t)(c < 0.0f ? c - 0.5f : c + 0.5f);
}

/* A coordinate in sub-pixels. */
static int32_t sub_pixels(float v)
{
    return nearest(v * (float)SUB, (float)(RAST_LIMIT * SUB));
}

/* First row whose centre is at or below y sub-pixels. */
static int32_t row_from(int32_t y)
{
    return (y + SUB - 1) >> 8;
}

/* The edge between two vertices in sub-pixels, the same in both directions. Because the slope is rounded,
 * its column is off by less than 1/256 pixel plus 1/65536 per row from its top. */
static edge edge_of(int32_t xa, int32_t ya, int32_t xb, int32_t yb)
{
    bool const down = ya < yb;
    int32_t const x0 = down ? xa : xb, y0 = down ? ya : yb, x1 = down ? xb : xa, y1 = down ? yb : ya;
    int32_t const first = row_from(y0);
    float const most = 2147483520.0f; /* the largest float below 2^31; only edges between two rows reach it */
    float const slope = (float)(x1 - x0) / (float)i_max(y1 - y0, 1);
    int32_t const step = nearest(slope * 65536.0f, most);
    int32_t const start = nearest(slope * (float)(first * SUB - y0) * 256.0f, most);
    uint32_t const at = (uint32_t)x0 * 256u + (uint32_t)start - (uint32_t)step * (uint32_t)first;
    return (edge){first, row_from(y1), at + 65535u, (uint32_t)step};
}

/* Column of the first pixel centre at or right of an edge, in a row that the edge crosses. */
static int32_t column(const edge *e, int32_t y)
{
    return (int32_t)(e->at + e->slope * (uint32_t)y) >> 16;
}

/* A convex polygon has two edges in each row between its top and its bottom. */
void rast_convex(const float *x, const float *y, int32_t n, int32_t top, int32_t width, rast_spans *out)
{
    int32_t first = top + GRID_SIZE, last = top;
    for (int32_t row = 0; row < GRID_SIZE; row++) {
        out->begin[row] = (int16_t)width;
        out->end[row] = 0;
    }
    for (int32_t i = 0, j = n - 1; i < n; j = i++) {
        edge const e = edge_of(sub_pixels(x[j]), sub_pixels(y[j]), sub_pixels(x[i]), sub_pixels(y[i]));
        int32_t const from = i_max(e.first, top), to = i_min(e.last, top + GRID_SIZE);
        for (int32_t row = from; row < to; row++) {
            int32_t const at = i_clamp(column(&e, row), 0, width);
            out->begin[row - top] = (int16_t)i_min(out->begin[row - top], at);
            out->end[row - top] = (int16_t)i_max(out->end[row - top], at);
        }
        first = from < to ? i_min(first, from) : first;
        last = from < to ? i_max(last, to) : last;
    }
    out->first = i_min(first, last);
    out->last = last;
}
