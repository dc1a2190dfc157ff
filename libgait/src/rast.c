#include "rast.h"
#include "base.h"

enum { SUB = 256 }; /* sub-pixel steps */

static int32_t to_sub(float v)
{
    float const lim = (float)RAST_LIMIT;
    float const c = v > -lim ? (v < lim ? v : lim) : -lim; /* also catches NaN */
    float const s = c * (float)SUB;
    return (int32_t)(s < 0.0f ? s - 0.5f : s + 0.5f);
}

static int32_t ceil_div(int32_t a, int32_t b)
{
    int32_t const q = a / b;
    return q + (q * b < a);
}

/* Column of the first pixel centre at or right of the edge, for each row the edge crosses. */
static void walk_edge(int32_t x0, int32_t y0, int32_t x1, int32_t y1, int32_t top, int16_t *bound,
                      int32_t width)
{
    int32_t const first = i_max(ceil_div(y0, SUB), top);
    int32_t const last = i_min(ceil_div(y1, SUB), top + RAST_SIZE);
    if (first >= last)
        return;
    int64_t const slope = ((int64_t)(x1 - x0) * 65536) / (y1 - y0); /* 16.16 sub-pixels per sub-row */
    int64_t x = (int64_t)x0 * 65536 + slope * (first * SUB - y0);
    for (int32_t y = first; y < last; y++, x += slope * SUB) {
        int64_t const column = (x + (int64_t)SUB * 65536 - 1) >> 24; /* ceiling; >> floors */
        bound[y - top] = (int16_t)(column < 0 ? 0 : column > width ? width : column);
    }
}

void rast_convex(const float *x, const float *y, int32_t n, int32_t top, int32_t width, rast_spans *out)
{
    int32_t px[RAST_MAX_VERTICES], py[RAST_MAX_VERTICES];
    int32_t low = INT32_MAX, high = INT32_MIN;
    int64_t area = 0;
    for (int32_t i = 0; i < n; i++) {
        px[i] = to_sub(x[i]);
        py[i] = to_sub(y[i]);
        low = i_min(low, py[i]);
        high = i_max(high, py[i]);
    }
    for (int32_t i = 0, j = n - 1; i < n; j = i++)
        area += (int64_t)px[j] * py[i] - (int64_t)px[i] * py[j];
    out->first = i_max(ceil_div(low, SUB), top);
    out->last = i_min(ceil_div(high, SUB), top + RAST_SIZE);
    if (out->first >= out->last || area == 0) {
        out->first = out->last = top;
        return;
    }
    for (int32_t row = out->first - top; row < out->last - top; row++)
        out->begin[row] = out->end[row] = 0; /* rounding may leave a sliver without one of its edges */
    for (int32_t i = 0, j = n - 1; i < n; j = i++) {
        bool const down = py[j] < py[i];
        /* With y down and positive area (clockwise on screen) the edges going up are the left ones. */
        int16_t *const bound = down == (area > 0) ? out->end : out->begin;
        if (down)
            walk_edge(px[j], py[j], px[i], py[i], top, bound, width);
        else if (py[j] > py[i])
            walk_edge(px[i], py[i], px[j], py[j], top, bound, width);
    }
}

/* Bits [begin, end) of the word that starts at column base. */
static uint64_t span_word(int32_t begin, int32_t end, int32_t base)
{
    int32_t const b = i_clamp(begin - base, 0, 64), e = i_clamp(end - base, 0, 64);
    if (b >= e)
        return 0;
    uint64_t const upto = e == 64 ? ~UINT64_C(0) : (UINT64_C(1) << e) - 1;
    return upto & (~UINT64_C(0) << b);
}

void rast_fill(const rast_spans *spans, rast_mask *out)
{
    out->first = spans->first;
    out->last = spans->last;
    for (int32_t y = spans->first; y < spans->last; y++)
        for (int32_t w = 0; w < RAST_WORDS; w++)
            out->row[y][w] = span_word(spans->begin[y], spans->end[y], 64 * w);
}
