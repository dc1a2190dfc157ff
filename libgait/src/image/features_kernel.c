/* Feature maps of the working image: foreground probability, edge tensors, local contrast and its vertical pairs. */
#include "image/features.h"
#include "base/dispatch.h"
#include <string.h>

/* ---- foreground probability of the grid's cells, by comparison with the background plate ---- */

/* Exposure of the frame relative to the plate in 1/256, between half and double, over pixels that changed
 * little. */
static int32_t exposure_gain(const view_planes *im, const view_planes *plate)
{
    int64_t frame = 0, scene = 0, count = 0;
    for (int32_t c = 0; c < im->channels; c++)
        for (int32_t y = 0; y < VIEW_SIZE; y++) {
            const uint8_t *const a = im->channel[c] + y * VIEW_SIZE, *const b =
                                                                         plate->channel[c] + y * VIEW_SIZE;
            uint16_t sum_a = 0, sum_b = 0, calm = 0; /* of one row: 256 x 255 fits */
            for (int32_t i = 0; i < VIEW_SIZE; i++) {
                uint16_t const take = (uint16_t)(a[i] - b[i] + 31) < 63 ? 0xffff : 0;
                sum_a = (uint16_t)(sum_a + (a[i] & take));
                sum_b = (uint16_t)(sum_b + (b[i] & take));
                calm = (uint16_t)(calm + (take & 1));
            }
            frame += sum_a;
            scene += sum_b;
            count += calm;
        }
    /* Too few or too dark pixels do not determine the exposure. */
    if (count < VIEW_PIXELS / 16 || scene < 8 * count)
        return 256;
    return i_clamp((int32_t)(frame * 256 / scene), 128, 512);
}

/* Integer quotient of two numbers below 2^31. Exact, because a quotient of such integers that is not an
 * integer differs from the next integer by more than the rounding of a double. */
static int32_t quotient(int32_t a, int32_t b)
{
    return (int32_t)((double)a / (double)b);
}

typedef struct cells { /* one row of the grid, summed over the channels */
    int32_t total[GRID_SIZE], across[GRID_SIZE], scene2[GRID_SIZE]; /* |I - B|^2, <I, B>, <B, B> */
} cells;

KERNEL_ROW void cells_add(cells *restrict s, const uint8_t *restrict a, const uint8_t *restrict b,
                          int32_t gain)
{
    for (int32_t x = 0; x < GRID_SIZE; x++) {
        int32_t const i = 2 * x, j = i + VIEW_SIZE;
        int32_t const frame = (a[i] + a[i + 1] + a[j] + a[j + 1]) >> 2;
        int32_t const scene = (b[i] + b[i + 1] + b[j] + b[j + 1]) * gain >> 10;
        int32_t const d = frame - scene;
        s->total[x] += d * d;
        s->across[x] += frame * scene;
        s->scene2[x] += scene * scene;
    }
}

/* A change that a shadow explains (the plate's colour at 2/5 to 1 of its brightness) counts only 1 /
 * SHADOW_SHARE. */
static int32_t without_shadow(int32_t total, int32_t across, int32_t scene2)
{
    enum { SHADOW_SHARE = 6 };
    int32_t const ratio = quotient(256 * across, i_max(scene2, 1)); /* to the plate, 1/256 */
    int32_t const dark = ratio >= 102 && ratio < 256 ? 256 - ratio : 0;
    /* |I - B|^2 = |I - r B|^2 + (1 - r)^2 |B|^2: colour and brightness */
    int32_t const shade = i_min((dark * dark / 256) * (scene2 / 16) / 16, total);
    return total - shade + shade / SHADOW_SHARE;
}

/* Foreground probabilities of a row, FOREGROUND_ONE = 1, from the squared change of each cell of 2 x 2
 * pixels: grey levels squared, summed over three channels. */
KERNEL_ROW void probability_row(cells *restrict s, int32_t channels, uint8_t *restrict p)
{
    int32_t const half = 3 * 9 * 9; /* squared difference at which a cell is as likely foreground as not */
    if (channels == 1)
        for (int32_t x = 0; x < GRID_SIZE; x++)
            s->total[x] *= 3;
    else
        for (int32_t x = 0; x < GRID_SIZE; x++)
            s->total[x] = without_shadow(s->total[x], s->across[x], s->scene2[x]);
    for (int32_t x = 0; x < GRID_SIZE; x++) {
        int32_t const d = s->total[x];
        p[x] = (uint8_t)quotient(FOREGROUND_ONE * d + (d + half) / 2, d + half);
    }
}

/* Bit k of 64 bytes. */
static uint64_t bits_of(const uint8_t *p, int32_t k)
{
    uint64_t out = 0;
    for (int32_t i = 0; i < 8; i++) {
        uint64_t v;
        memcpy(&v, p + 8 * i, sizeof v);
        v = v >> k & UINT64_C(0x0101010101010101);
        out |= (v * UINT64_C(0x0102040810204080) >> 56) << (8 * i);
    }
    return out;
}

void KERNEL(features_foreground)(features *f, const view_planes *im, const view_planes *plate)
{
    int32_t const gain = exposure_gain(im, plate);
    f->foreground_total = 0;
    for (int32_t y = 0; y < GRID_SIZE; y++) {
        cells row = {.total = {0}};
        uint8_t p[GRID_SIZE];
        for (int32_t c = 0; c < im->channels; c++)
            cells_add(&row, im->channel[c] + 2 * y * VIEW_SIZE, plate->channel[c] + 2 * y * VIEW_SIZE, gain);
        probability_row(&row, im->channels, p);
        for (int32_t w = 0; w < GRID_WORDS; w++)
            for (int32_t k = 0; k < FOREGROUND_PLANES; k++) {
                uint64_t const bits = bits_of(p + 64 * w, k) & f->inside[y][w];
                f->foreground[k][y][w] = bits;
                f->foreground_total += grid_popcount(bits) << k;
            }
    }
}

/* ---- sums over a sliding window of a row, with its ends replicated ---- */

/* Width of a row with `radius` more values on each side. */
#define WINDOW_WIDTH(radius) (VIEW_SIZE + 2 * (radius))
#define WINDOW_AREA(radius)  ((2 * (radius) + 1) * (2 * (radius) + 1))

enum { EDGE_RADIUS = 12, CONTRAST_RADIUS = 9, LAST = VIEW_SIZE - 1 };

/* Replicate the first and last of the VIEW_SIZE values that begin at padded[radius]. */
static void window_ends(int32_t *padded, int32_t radius)
{
    for (int32_t i = 0; i < radius; i++) {
        padded[i] = padded[radius];
        padded[radius + VIEW_SIZE + i] = padded[radius + VIEW_SIZE - 1];
    }
}

/* Sums of eight neighbours, from which the sums of longer windows are made: out[i] = padded[i] + ... +
 * padded[i + 7]. */
static void window_eight(const int32_t *padded, int32_t radius, int32_t *restrict out)
{
    for (int32_t i = 0; i < WINDOW_WIDTH(radius) - 7; i++)
        out[i] = ((padded[i] + padded[i + 1]) + (padded[i + 2] + padded[i + 3])) +
                 ((padded[i + 4] + padded[i + 5]) + (padded[i + 6] + padded[i + 7]));
}

/* ---- edge tensors, row by row: gradient, local mean of its size, tensor, smoothing ---- */

typedef struct padded_row { /* with one value more on each side */
    int16_t v[VIEW_SIZE + 2];
} padded_row;

static void replicate_ends(padded_row *r)
{
    r->v[0] = r->v[1];
    r->v[VIEW_SIZE + 1] = r->v[VIEW_SIZE];
}

/* Gradient of the binomially smoothed image (Sobel's kernel, 8 per grey level and pixel); 0 at the border. */
KERNEL_ROW void gradient_row(const uint8_t *restrict grey, int32_t y, int16_t *restrict gx,
                             int16_t *restrict gy)
{
    const uint8_t *const p = grey + y * VIEW_SIZE;
    padded_row sum, rise; /* of three rows: smoothed, and the lower minus the upper */
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

/* Sums over 2 EDGE_RADIUS + 1 of the column sums. */
KERNEL_ROW void edge_sum_row(const uint16_t *restrict column, int32_t *restrict sum)
{
    int32_t padded[WINDOW_WIDTH(EDGE_RADIUS)], eight[WINDOW_WIDTH(EDGE_RADIUS)];
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        padded[EDGE_RADIUS + i] = column[i];
    window_ends(padded, EDGE_RADIUS);
    window_eight(padded, EDGE_RADIUS, eight);
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        sum[i] = eight[i] + eight[i + 8] + eight[i + 16] + padded[i + 24];
}

/* gg'/(|g|^2 + k^2): an outer product that saturates at trace 1, with k^2 from the local mean gradient and a
 * noise floor. */
KERNEL_ROW void tensor_row(const int16_t *restrict gx, const int16_t *restrict gy,
                           const int32_t *restrict sum, padded_row *restrict out)
{
    float const floor2 = 40.0f * 40.0f; /* 5 grey levels per pixel in Sobel units */
    float const inv = 1.0f / (float)WINDOW_AREA(EDGE_RADIUS);
    float const one = 8.0f * (float)EDGE_ONE;
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        float const x = (float)gx[i], y = (float)gy[i], mean = (float)sum[i] * inv;
        float const k = one / (x * x + y * y + 2.0f * mean * mean + floor2);
        out[0].v[i + 1] = (int16_t)(int32_t)(x * x * k);
        out[1].v[i + 1] = (int16_t)(int32_t)(y * y * k);
        out[2].v[i + 1] = (int16_t)(int32_t)(x * y * k);
    }
}

/* Smooth a row with 1-2-1. */
KERNEL_ROW void smooth_along(padded_row *restrict in, int16_t *restrict out)
{
    replicate_ends(in);
    for (int32_t x = 0; x < VIEW_SIZE; x++)
        out[x] = (int16_t)(in->v[x] + 2 * in->v[x + 1] + in->v[x + 2]);
}

/* Smooth across three rows with 1-2-1 and divide by 16, towards zero. */
KERNEL_ROW void smooth_across(const int16_t *restrict u, const int16_t *restrict p, const int16_t *restrict d,
                              int16_t *restrict out)
{
    for (int32_t x = 0; x < VIEW_SIZE; x++) {
        int16_t const sum = (int16_t)(u[x] + 2 * p[x] + d[x]);
        out[x] = (int16_t)((int16_t)(sum + (sum >> 15 & 15)) >> 4);
    }
}

/* The same for row y of a ring of rows. */
static void smooth_ring(int16_t (*ring)[VIEW_SIZE], int32_t y, int16_t *out)
{
    smooth_across(ring[i_max(y - 1, 0) % EDGE_SMOOTH_ROWS], ring[y % EDGE_SMOOTH_ROWS],
                  ring[i_min(y + 1, LAST) % EDGE_SMOOTH_ROWS], out);
}

KERNEL_ROW void pack_row(const int16_t *restrict xx, const int16_t *restrict yy, const int16_t *restrict xy,
                         edge_cell *restrict out)
{
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        uint32_t const trace = (uint8_t)((xx[i] + yy[i]) / 8), xx_yy = (uint8_t)((xx[i] - yy[i]) / 8);
        uint32_t const xy2 = (uint8_t)(xy[i] / 4), cell = trace | xx_yy << 8 | xy2 << 24;
        memcpy(&out[i], &cell, sizeof cell); /* in the order of the fields of edge_cell */
    }
}

/* Tensors of row y, smoothed along the row, into the first ring. */
static void begin_row(const uint8_t *grey, int32_t y, const uint16_t *column, edge_rows *s)
{
    int16_t gx[VIEW_SIZE], gy[VIEW_SIZE];
    int32_t sum[VIEW_SIZE];
    padded_row tensor[3];
    edge_sum_row(column, sum);
    gradient_row(grey, y, gx, gy);
    tensor_row(gx, gy, sum, tensor);
    for (int32_t k = 0; k < 3; k++)
        smooth_along(&tensor[k], s->once[k][y % EDGE_SMOOTH_ROWS]);
}

/* Smooth row y across and once more along, into the second ring. */
static void middle_row(int32_t y, edge_rows *s)
{
    padded_row row;
    for (int32_t k = 0; k < 3; k++) {
        smooth_ring(s->once[k], y, row.v + 1);
        smooth_along(&row, s->twice[k][y % EDGE_SMOOTH_ROWS]);
    }
}

static void end_row(int32_t y, edge_rows *s, edge_cell *out)
{
    int16_t row[3][VIEW_SIZE];
    for (int32_t k = 0; k < 3; k++)
        smooth_ring(s->twice[k], y, row[k]);
    pack_row(row[0], row[1], row[2], out + y * VIEW_SIZE);
}

/* Smoothing twice with 1-2-1 in both directions gives the tolerance for the position of an edge, about 1.4
 * pixels. */
void KERNEL(features_edges)(const uint8_t *grey, edge_cell *out, edge_rows *s)
{
    uint16_t column[VIEW_SIZE]; /* sums of the gradient size over 2 EDGE_RADIUS + 1 rows */
    for (int32_t y = 0; y <= EDGE_RADIUS; y++) {
        uint16_t *const size = s->size[y % EDGE_SIZE_ROWS];
        size_row(grey, y, size);
        for (int32_t x = 0; x < VIEW_SIZE; x++)
            column[x] = (uint16_t)(y == 0 ? (EDGE_RADIUS + 1) * size[x] : column[x] + size[x]);
    }
    for (int32_t y = 0; y < VIEW_SIZE + 2; y++) {
        if (y < VIEW_SIZE) {
            const uint16_t *const sub = s->size[i_max(y - EDGE_RADIUS, 0) % EDGE_SIZE_ROWS];
            uint16_t *const add = s->size[i_min(y + EDGE_RADIUS + 1, LAST) % EDGE_SIZE_ROWS];
            begin_row(grey, y, column, s);
            if (y + EDGE_RADIUS + 1 <= LAST)
                size_row(grey, y + EDGE_RADIUS + 1, add);
            for (int32_t x = 0; x < VIEW_SIZE; x++)
                column[x] = (uint16_t)(column[x] + add[x] - sub[x]);
        }
        if (y >= 1 && y <= VIEW_SIZE)
            middle_row(y - 1, s);
        if (y >= 2)
            end_row(y - 2, s, out);
    }
}

/* ---- local contrast: grey level by the mean and standard deviation of a box around it ---- */

typedef struct columns { /* sums over 2 CONTRAST_RADIUS + 1 rows, with the ends replicated */
    int32_t grey[WINDOW_WIDTH(CONTRAST_RADIUS)], square[WINDOW_WIDTH(CONTRAST_RADIUS)];
} columns;

KERNEL_ROW void columns_add(columns *restrict c, const uint8_t *restrict row, int32_t times)
{
    for (int32_t x = 0; x < VIEW_SIZE; x++) {
        c->grey[CONTRAST_RADIUS + x] += times * row[x];
        c->square[CONTRAST_RADIUS + x] += times * (row[x] * row[x]);
    }
}

KERNEL_ROW void contrast_sum_row(const int32_t *restrict padded, int32_t *restrict sum)
{
    int32_t eight[WINDOW_WIDTH(CONTRAST_RADIUS)];
    window_eight(padded, CONTRAST_RADIUS, eight);
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        sum[i] = (eight[i] + eight[i + 8]) + ((padded[i + 16] + padded[i + 17]) + padded[i + 18]);
}

static void contrast_row(const uint8_t *grey, columns *c, int8_t *restrict out)
{
    float const inv = 1.0f / (float)WINDOW_AREA(CONTRAST_RADIUS), floor2 = 6.0f * 6.0f;
    int32_t sum[VIEW_SIZE], square[VIEW_SIZE];
    window_ends(c->grey, CONTRAST_RADIUS);
    window_ends(c->square, CONTRAST_RADIUS);
    contrast_sum_row(c->grey, sum);
    contrast_sum_row(c->square, square);
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
    columns_add(&c, grey, CONTRAST_RADIUS + 1);
    for (int32_t y = 1; y <= CONTRAST_RADIUS; y++)
        columns_add(&c, grey + y * VIEW_SIZE, 1);
    for (int32_t y = 0; y < VIEW_SIZE; y++) {
        contrast_row(grey + y * VIEW_SIZE, &c, out + y * VIEW_SIZE);
        columns_add(&c, grey + i_min(y + CONTRAST_RADIUS + 1, LAST) * VIEW_SIZE, 1);
        columns_add(&c, grey + i_max(y - CONTRAST_RADIUS, 0) * VIEW_SIZE, -1);
    }
}

/* ---- each value with the one below it, so that bilinear interpolation reads one word ---- */

enum { PAIRS = VIEW_PIXELS - VIEW_SIZE, PAIRS_AT_ONCE = 64 };

KERNEL_ROW void pack_pairs(const uint8_t *restrict p, uint16_t *restrict pairs)
{
    for (int32_t i = 0; i < PAIRS_AT_ONCE; i++)
        pairs[i] = (uint16_t)(p[i] | p[i + VIEW_SIZE] << 8);
}

/* The last row has no pairs; it is never read. */
void KERNEL(features_pairs)(const int8_t *surface, uint16_t *pairs)
{
    for (int32_t i = 0; i < PAIRS; i += PAIRS_AT_ONCE)
        pack_pairs((const uint8_t *)surface + i, pairs + i);
}
