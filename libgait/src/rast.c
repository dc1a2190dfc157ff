#include "rast.h"

/* A convex polygon has two edges in each row between its top and its bottom. */
void rast_convex(const float *x, const float *y, int32_t n, int32_t top, int32_t width, rast_spans *out)
{
    int32_t first = top + RAST_SIZE, last = top;
    for (int32_t row = 0; row < RAST_SIZE; row++) {
        out->begin[row] = (int16_t)width;
        out->end[row] = 0;
    }
    for (int32_t i = 0, j = n - 1; i < n; j = i++) {
        rast_edge const e = rast_edge_of(rast_sub(x[j]), rast_sub(y[j]), rast_sub(x[i]), rast_sub(y[i]));
        int32_t const from = i_max(e.first, top), to = i_min(e.last, top + RAST_SIZE);
        for (int32_t row = from; row < to; row++) {
            int32_t const column = i_clamp(rast_column(e.at, e.slope, row), 0, width);
            out->begin[row - top] = (int16_t)i_min(out->begin[row - top], column);
            out->end[row - top] = (int16_t)i_max(out->end[row - top], column);
        }
        first = from < to ? i_min(first, from) : first;
        last = from < to ? i_max(last, to) : last;
    }
    out->first = i_min(first, last);
    out->last = last;
}
