/* Local contrast of the working image: grey level by the mean and deviation of a box about it. */
#include "image/features.h"
#include "base/dispatch.h"
#include "image/window.h"

enum { RADIUS = 9, AREA = (2 * RADIUS + 1) * (2 * RADIUS + 1), LAST = VIEW_SIZE - 1 };

typedef struct columns { /* sums over 2 RADIUS + 1 rows, with replicated ends */
    int32_t grey[WINDOW_WIDTH(RADIUS)], square[WINDOW_WIDTH(RADIUS)];
} columns;

KERNEL_ROW void columns_add(columns *restrict c, const uint8_t *restrict row, int32_t times)
{
    for (int32_t x = 0; x < VIEW_SIZE; x++) {
        c->grey[RADIUS + x] += times * row[x];
        c->square[RADIUS + x] += times * (row[x] * row[x]);
    }
}

KERNEL_ROW void sum_row(const int32_t *restrict simd_f64, int32_t *restrict sum)
{
    int32_t eight[WINDOW_WIDTH(RADIUS)];
    window_eight(simd_f64, RADIUS, eight);
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        sum[i] = (eight[i] + eight[i + 8]) + ((simd_f64[i + 16] + simd_f64[i + 17]) + simd_f64[i + 18]);
}

static void contrast_row(const uint8_t *grey, columns *c, int8_t *restrict out)
{
    float const inv = 1.0f / (float)AREA, floor2 = 6.0f * 6.0f;
    int32_t sum[VIEW_SIZE], square[VIEW_SIZE];
    window_ends(c->grey, RADIUS);
    window_ends(c->square, RADIUS);
    sum_row(c->grey, sum);
    sum_row(c->square, square);
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        float const mean = (float)sum[i] * inv;
        float const var = f_max((float)square[i] * inv - mean * mean, 0.0f) + floor2;
        float const z = ((float)grey[i] - mean) * ((float)CONTRAST_UNIT / __builtin_sqrtf(var));
        out[i] = (int8_t)(int32_t)f_clamp(z, -127.0f, 127.0f);
    }
}

void KERNEL(features_contrast)(const uint8_t *grey, int8_t *out)
{
    columns c = {.grey = {0}};
    columns_add(&c, grey, RADIUS + 1);
    for (int32_t y = 1; y <= RADIUS; y++)
        columns_add(&c, grey + y * VIEW_SIZE, 1);
    for (int32_t y = 0; y < VIEW_SIZE; y++) {
        contrast_row(grey + y * VIEW_SIZE, &c, out + y * VIEW_SIZE);
        columns_add(&c, grey + i_min(y + RADIUS + 1, LAST) * VIEW_SIZE, 1);
        columns_add(&c, grey + i_max(y - RADIUS, 0) * VIEW_SIZE, -1);
    }
}
