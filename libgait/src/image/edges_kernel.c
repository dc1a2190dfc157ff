/* Edge tensors of the working image, row by row: gradient, local mean of its size, tensor, smoothing. */
#include "image/features.h"
#include "base/dispatch.h"
#include "image/window.h"
#include <string.h>

enum { RADIUS = 12, AREA = (2 * RADIUS + 1) * (2 * RADIUS + 1), LAST = VIEW_SIZE - 1 };

typedef struct simd_f64_row { /* with one value more on each side */
    int16_t v[VIEW_SIZE + 2];
} simd_f64_row;

static void replicate_ends(simd_f64_row *r)
{
    r->v[0] = r->v[1];
    r->v[VIEW_SIZE + 1] = r->v[VIEW_SIZE];
}

/* Gradient of the binomially smoothed image (Sobel's kernel, 8 per grey level and pixel); 0 at the border. */
KERNEL_ROW void gradient_row(const uint8_t *restrict grey, int32_t y, int16_t *restrict gx,
                             int16_t *restrict gy)
{
    const uint8_t *const p = grey + y * VIEW_SIZE;
    simd_f64_row sum, rise; /* of three rows: smoothed, and from the upper to the lower */
    if (y == 0 || y == LAST) {
        memset(gx, 0, VIEW_SIZE * sizeof *gx);
        memset(gy, 0, VIEW_SIZE * sizeof *gy);
        return;
    }
    for (int32_t x = 0; x < VIEW_SIZE; x++) {
        int16_t const u = p[x - VIEW_SIZE], d = p[x + VIEW_SIZE];
        sum.v[x + 1] = (int16_t)(u + 2 * p[x] + d);
        rise.v[x + 1] = (int16_t)(d - u);
    }
    replicate_ends(&sum);
    replicate_ends(&rise);
    for (int32_t x = 0; x < VIEW_SIZE; x++) {
        gx[x] = (int16_t)(sum.v[x + 2] - sum.v[x]);
        gy[x] = (int16_t)(rise.v[x] + 2 * rise.v[x + 1] + rise.v[x + 2]);
    }
    gx[0] = gy[0] = gx[LAST] = gy[LAST] = 0;
}

KERNEL_ROW void size_row(const uint8_t *restrict grey, int32_t y, uint16_t *restrict size)
{
    int16_t gx[VIEW_SIZE], gy[VIEW_SIZE];
    gradient_row(grey, y, gx, gy);
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        float const x = (float)gx[i], v = (float)gy[i];
        size[i] = (uint16_t)(int32_t)__builtin_sqrtf(x * x + v * v);
    }
}

/* Sums of the columns' sums over 2 RADIUS + 1 of them. */
KERNEL_ROW void sum_row(const uint16_t *restrict column, int32_t *restrict sum)
{
    int32_t simd_f64[WINDOW_WIDTH(RADIUS)], eight[WINDOW_WIDTH(RADIUS)];
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        simd_f64[RADIUS + i] = column[i];
    window_ends(simd_f64, RADIUS);
    window_eight(simd_f64, RADIUS, eight);
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        sum[i] = eight[i] + eight[i + 8] + eight[i + 16] + simd_f64[i + 24];
}

/* gg'/(|g|^2 + k^2): an outer product that saturates at trace 1, k = local mean gradient and a noise floor. */
KERNEL_ROW void tensor_row(const int16_t *restrict gx, const int16_t *restrict gy,
                           const int32_t *restrict sum, simd_f64_row *restrict out)
{
    float const floor2 = 40.0f * 40.0f; /* 5 grey levels per pixel in Sobel units */
    float const inv = 1.0f / (float)AREA;
    float const one = 8.0f * (float)EDGE_ONE;
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        float const x = (float)gx[i], y = (float)gy[i], mean = (float)sum[i] * inv;
        float const k = one / (x * x + y * y + 2.0f * mean * mean + floor2);
        out[0].v[i + 1] = (int16_t)(int32_t)(x * x * k);
        out[1].v[i + 1] = (int16_t)(int32_t)(y * y * k);
        out[2].v[i + 1] = (int16_t)(int32_t)(x * y * k);
    }
}

/* 1-2-1 along a row. */
KERNEL_ROW void soften_along(simd_f64_row *restrict in, int16_t *restrict out)
{
    replicate_ends(in);
    for (int32_t x = 0; x < VIEW_SIZE; x++)
        out[x] = (int16_t)(in->v[x] + 2 * in->v[x + 1] + in->v[x + 2]);
}

/* 1-2-1 across three rows, over 16 towards zero. */
KERNEL_ROW void soften_across(const int16_t *restrict u, const int16_t *restrict p, const int16_t *restrict d,
                              int16_t *restrict out)
{
    for (int32_t x = 0; x < VIEW_SIZE; x++) {
        int16_t const sum = (int16_t)(u[x] + 2 * p[x] + d[x]);
        out[x] = (int16_t)((int16_t)(sum + (sum >> 15 & 15)) >> 4);
    }
}

/* The same for row y of a ring. */
static void soften_ring(int16_t (*ring)[VIEW_SIZE], int32_t y, int16_t *out)
{
    soften_across(ring[i_max(y - 1, 0) % EDGE_SOFT], ring[y % EDGE_SOFT],
                  ring[i_min(y + 1, LAST) % EDGE_SOFT], out);
}

KERNEL_ROW void pack_row(const int16_t *restrict xx, const int16_t *restrict yy, const int16_t *restrict xy,
                         edge_cell *restrict out)
{
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        uint32_t const trace = (uint8_t)((xx[i] + yy[i]) / 8), xx_yy = (uint8_t)((xx[i] - yy[i]) / 8);
        uint32_t const xy2 = (uint8_t)(xy[i] / 4), cell = trace | xx_yy << 8 | xy2 << 24;
        memcpy(&out[i], &cell, sizeof cell); /* in the order of edge_cell */
    }
}

/* Tensors of row y into the first ring, smoothed along the row. */
static void begin_row(const uint8_t *grey, int32_t y, const uint16_t *column, edge_rows *s)
{
    int16_t gx[VIEW_SIZE], gy[VIEW_SIZE];
    int32_t sum[VIEW_SIZE];
    simd_f64_row tensor[3];
    sum_row(column, sum);
    gradient_row(grey, y, gx, gy);
    tensor_row(gx, gy, sum, tensor);
    for (int32_t k = 0; k < 3; k++)
        soften_along(&tensor[k], s->once[k][y % EDGE_SOFT]);
}

/* Row y across and once more along: into the second ring. */
static void middle_row(int32_t y, edge_rows *s)
{
    simd_f64_row row;
    for (int32_t k = 0; k < 3; k++) {
        soften_ring(s->once[k], y, row.v + 1);
        soften_along(&row, s->twice[k][y % EDGE_SOFT]);
    }
}

static void end_row(int32_t y, edge_rows *s, edge_cell *out)
{
    int16_t row[3][VIEW_SIZE];
    for (int32_t k = 0; k < 3; k++)
        soften_ring(s->twice[k], y, row[k]);
    pack_row(row[0], row[1], row[2], out + y * VIEW_SIZE);
}

/* 1-2-1 in both directions, twice, is the tolerance of an edge's place, about 1.4 pixels. */
void KERNEL(features_edges)(const uint8_t *grey, edge_cell *out, edge_rows *s)
{
    uint16_t column[VIEW_SIZE]; /* sums of the gradient's size over 2 RADIUS + 1 rows */
    for (int32_t y = 0; y <= RADIUS; y++) {
        uint16_t *const size = s->size[y % EDGE_SIZES];
        size_row(grey, y, size);
        for (int32_t x = 0; x < VIEW_SIZE; x++)
            column[x] = (uint16_t)(y == 0 ? (RADIUS + 1) * size[x] : column[x] + size[x]);
    }
    for (int32_t y = 0; y < VIEW_SIZE + 2; y++) {
        if (y < VIEW_SIZE) {
            const uint16_t *const sub = s->size[i_max(y - RADIUS, 0) % EDGE_SIZES];
            uint16_t *const add = s->size[i_min(y + RADIUS + 1, LAST) % EDGE_SIZES];
            begin_row(grey, y, column, s);
            if (y + RADIUS + 1 <= LAST)
                size_row(grey, y + RADIUS + 1, add);
            for (int32_t x = 0; x < VIEW_SIZE; x++)
                column[x] = (uint16_t)(column[x] + add[x] - sub[x]);
        }
        if (y >= 1 && y <= VIEW_SIZE)
            middle_row(y - 1, s);
        if (y >= 2)
            end_row(y - 2, s, out);
    }
}
