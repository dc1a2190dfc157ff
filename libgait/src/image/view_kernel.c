/* Resampling of a captured frame into the working image, row by row. */
#include "image/camera.h"
#include "base/dispatch.h"
#include "base/grid_mask.h"
#include "image/view.h"
#include <string.h>

enum {
    FRACTION = 256, /* fixed-point steps of a source pixel */
    MAX_SIDE = 16,  /* side of the box of source pixels that one working pixel averages */
    SPAN = 512,     /* source pixels of a row that are summed at once */
    LANES = 32,     /* numbers that are summed together */
    BOX_BYTES = (3 * (SPAN + MAX_SIDE) + LANES - 1) / LANES * LANES
};

typedef struct places { /* source positions of one row of the working image, 1/FRACTION pixels */
    int32_t u[VIEW_SIZE], v[VIEW_SIZE];
} places;

typedef struct
    taps { /* the first of the four source pixels around each working pixel, and the weights of the others */
    int32_t offset[VIEW_SIZE];
    uint32_t x[VIEW_SIZE], y[VIEW_SIZE];
} taps;

typedef struct blend { /* horizontally interpolated source pixels, times FRACTION */
    int32_t of;        /* offset of the first; -1: none yet */
    uint16_t channel[3][VIEW_SIZE];
} blend;

KERNEL_ROW void place_row(const view_map *map, const gait_camera *cam, bool bent, int32_t j, places *out)
{
    float const inv = 1.0f / map->scale, limit = 30000.0f;
    float u[VIEW_SIZE], v[VIEW_SIZE];
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        u[i] = map->u0 + (float)i * inv;
        v[i] = map->v0 + (float)j * inv;
    }
    if (bent)
        for (int32_t i = 0; i < VIEW_SIZE; i++)
            camera_distort(cam, u[i], v[i], &u[i], &v[i]);
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        out->u[i] = (int32_t)(f_clamp(u[i], -limit, limit) * (float)FRACTION);
        out->v[i] = (int32_t)(f_clamp(v[i], -limit, limit) * (float)FRACTION);
    }
}

/* ---- between four pixels ---- */

static uint8_t tap_bilinear(const gait_image *im, int32_t step, int32_t c, int32_t su, int32_t sv)
{
    int32_t const u = i_clamp(su, 0, (im->width - 1) * FRACTION),
                  v = i_clamp(sv, 0, (im->height - 1) * FRACTION);
    int32_t const x = u >> 8, y = v >> 8, fx = u & 255, fy = v & 255;
    int32_t const right = x + 1 < im->width ? step : 0;
    const uint8_t *const p = im->data + (size_t)y * (size_t)im->stride + (size_t)(x * step + c);
    const uint8_t *const q = p + (y + 1 < im->height ? im->stride : 0);
    int32_t const top = p[0] * (FRACTION - fx) + p[right] * fx, low = q[0] * (FRACTION - fx) + q[right] * fx;
    return (uint8_t)((top * (FRACTION - fy) + low * fy + (1 << 15)) >> 16);
}

/* Frames with fewer than two rows or columns, and frames whose offsets do not fit in 32 bits. */
static bool is_degenerate(const gait_image *im)
{
    return im->width < 2 || im->height < 2 || (int64_t)im->height * im->stride > INT32_MAX;
}

static void bilinear_degenerate(const gait_image *im, int32_t step, const places *at, uint8_t *const row[3])
{
    for (int32_t c = 0; c < step; c++)
        for (int32_t i = 0; i < VIEW_SIZE; i++)
            row[c][i] = tap_bilinear(im, step, c, at->u[i], at->v[i]);
}

/* A position in the last row or column is interpolated from the one before, with weight FRACTION. */
static void locate(const gait_image *im, int32_t step, const places *at, taps *restrict t)
{
    int32_t const right = im->width - 1, low = im->height - 1;
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        int32_t const u = i_clamp(at->u[i], 0, right * FRACTION), v = i_clamp(at->v[i], 0, low * FRACTION);
        int32_t const x = i_min(u / FRACTION, right - 1), y = i_min(v / FRACTION, low - 1);
        t->offset[i] = y * im->stride + x * step;
        t->x[i] = (uint32_t)(u - x * FRACTION);
        t->y[i] = (uint32_t)(v - y * FRACTION);
    }
}

/* Interpolate between the byte at bit `a` of word `wa` (left pixel) and the one at bit `b` of `wb` (right
 * pixel). */
static void blend_bytes(const uint32_t *restrict wa, int32_t a, const uint32_t *restrict wb, int32_t b,
                        const uint32_t *restrict x, uint16_t *restrict out)
{
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        out[i] = (uint16_t)((wa[i] >> a & 255u) * (FRACTION - x[i]) + (wb[i] >> b & 255u) * x[i]);
}

/* Two grey pixels are in one word, two colour pixels in two words: bytes r g b r and b r g b. */
static void blend_row(const uint8_t *from, int32_t step, const taps *t, blend *restrict out)
{
    uint32_t word[2][VIEW_SIZE];
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        const uint8_t *const p = from + t->offset[i];
        if (step == 1) {
            word[0][i] = p[0] | (uint32_t)p[1] << 8;
        } else {
            memcpy(&word[0][i], p, 4);
            memcpy(&word[1][i], p + 2, 4);
        }
    }
    if (step == 1) {
        blend_bytes(word[0], 0, word[0], 8, t->x, out->channel[0]);
    } else {
        blend_bytes(word[0], 0, word[0], 24, t->x, out->channel[0]);
        blend_bytes(word[0], 8, word[1], 16, t->x, out->channel[1]);
        blend_bytes(word[1], 0, word[1], 24, t->x, out->channel[2]);
    }
}

static void blend_rows(const uint16_t *restrict top, const uint16_t *restrict low, const uint32_t *restrict y,
                       uint8_t *restrict out)
{
    for (int32_t i = 0; i < VIEW_SIZE; i++)
        out[i] = (uint8_t)((top[i] * (FRACTION - y[i]) + low[i] * y[i] + (1u << 15)) >> 16);
}

/* Two consecutive source rows. Without lens distortion all working rows have the same columns, so that a row
 * interpolated for one working row serves the next. */
typedef struct blends {
    blend row[2];
} blends;

static const blend *kept_row(blends *kept, const gait_image *im, int32_t step, int32_t below, bool bent,
                             const taps *t)
{
    int32_t const of = t->offset[0] + below * im->stride;
    blend *const to = &kept->row[of / im->stride & 1];
    if (bent || to->of != of)
        blend_row(im->data + below * im->stride, step, t, to);
    to->of = of;
    return to;
}

KERNEL_ROW void bilinear_row(const gait_image *im, int32_t step, bool bent, const places *at, blends *kept,
                             uint8_t *const row[3])
{
    taps t;
    if (is_degenerate(im)) {
        bilinear_degenerate(im, step, at, row);
        return;
    }
    locate(im, step, at, &t);
    const blend *const top = kept_row(kept, im, step, 0, bent, &t);
    const blend *const low = kept_row(kept, im, step, 1, bent, &t);
    for (int32_t c = 0; c < step; c++)
        blend_rows(top->channel[c], low->channel[c], t.y, row[c]);
}

/* ---- mean of a box of pixels ---- */

typedef struct box {
    int32_t nx, ny;      /* pixels */
    uint32_t half, over; /* area / 2, and 2^24 / area rounded up: exact for sums of 256 pixels and fewer */
} box;

static box box_of(const gait_image *im, int32_t side)
{
    box b = {.nx = i_min(side, im->width), .ny = i_min(side, im->height)};
    uint32_t const area = (uint32_t)(b.nx * b.ny);
    b.half = area / 2;
    b.over = ((1u << 24) + area - 1) / area;
    return b;
}

/* out = a + b, `count` numbers and those up to the next multiple of LANES. */
static void add_lanes(const uint16_t *a, const uint16_t *b, uint16_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; i += LANES)
        KERNEL_LANES for (int32_t k = i; k < i + LANES; k++) out[k] = (uint16_t)(a[k] + b[k]);
}

/* Into sum, for each byte: the sum over ny rows and nx pixels to the right. Sums that reach beyond the last
 * byte are incomplete. */
static void box_sums(const uint8_t *from, int32_t stride, int32_t step, const box *b, int32_t bytes,
                     uint16_t *restrict sum)
{
    uint16_t part[2][BOX_BYTES + 3 * MAX_SIDE]; /* of n pixels, and of 2 n */
    memset(part, 0, sizeof part);
    memset(sum, 0, BOX_BYTES * sizeof *sum);
    for (int32_t y = 0; y < b->ny; y++)
        for (int32_t k = 0; k < bytes; k++)
            part[0][k] = (uint16_t)(part[0][k] + from[y * stride + k]);
    for (int32_t n = 1, done = 0, of = 0; n <= b->nx; n *= 2, of = 1 - of) {
        if (b->nx & n) {
            add_lanes(part[of] + done * step, sum, sum, bytes);
            done += n;
        }
        add_lanes(part[of], part[of] + n * step, part[1 - of], bytes);
    }
}

/* End of the run of working pixels from `begin` whose boxes lie in the same rows and in one span; low, high:
 * their columns. */
static int32_t run_end(const places *corner, int32_t begin, int32_t *low, int32_t *high)
{
    int32_t end = begin;
    *low = *high = corner->u[begin];
    while (++end < VIEW_SIZE && corner->v[end] == corner->v[begin]) {
        int32_t const left = i_min(*low, corner->u[end]), right = i_max(*high, corner->u[end]);
        if (right - left > SPAN)
            break;
        *low = left;
        *high = right;
    }
    return end;
}

/* at: source positions on entry; receives the corners of their boxes. */
KERNEL_ROW void box_row(const gait_image *im, int32_t step, int32_t side, places *at, uint8_t *const row[3])
{
    box const b = box_of(im, side);
    int32_t const offset = FRACTION / 2 - (side - 1) * FRACTION / 2;
    int32_t const right = im->width - b.nx, low = im->height - b.ny;
    uint16_t sum[BOX_BYTES];
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        at->u[i] = i_clamp((at->u[i] + offset) >> 8, 0, right);
        at->v[i] = i_clamp((at->v[i] + offset) >> 8, 0, low);
    }
    for (int32_t begin = 0, end; begin < VIEW_SIZE; begin = end) {
        int32_t from, to;
        end = run_end(at, begin, &from, &to);
        box_sums(im->data + (size_t)at->v[begin] * (size_t)im->stride + (size_t)(from * step), im->stride,
                 step, &b, (to - from + b.nx) * step, sum);
        for (int32_t c = 0; c < step; c++) {
            uint8_t *restrict const out = row[c];
            for (int32_t i = begin; i < end; i++)
                out[i] = (uint8_t)((sum[(at->u[i] - from) * step + c] + b.half) * b.over >> 24);
        }
    }
}

/* ---- all rows ---- */

void KERNEL(view_rows)(const view_map *map, const gait_camera *cam, const gait_image *im, int32_t begin,
                       int32_t end, const view_planes *out)
{
    int32_t const step = im->format == GAIT_GREY8 ? 1 : 3;
    int32_t const side = i_clamp((int32_t)(1.0f / map->scale), 1, MAX_SIDE);
    bool const bent = camera_distorted(cam), swap = im->format == GAIT_BGR8;
    blends kept;
    kept.row[0].of = kept.row[1].of = -1;
    for (int32_t j = begin; j < end; j++) {
        places at;
        uint8_t *row[3]; /* planes are R, G, B whatever the order in the frame */
        for (int32_t c = 0; c < step; c++)
            row[c] = out->channel[swap ? 2 - c : c] + j * VIEW_SIZE;
        place_row(map, cam, bent, j, &at);
        if (side == 1)
            bilinear_row(im, step, bent, &at, &kept, row);
        else
            box_row(im, step, side, &at, row);
    }
}

void KERNEL(view_inside)(const view_map *map, const gait_camera *cam, uint64_t (*inside)[2])
{
    int32_t const right = (cam->width - 1) * FRACTION, low = (cam->height - 1) * FRACTION;
    bool const bent = camera_distorted(cam);
    for (int32_t y = 0; y < GRID_SIZE; y++) {
        places at;
        place_row(map, cam, bent, 2 * y, &at);
        inside[y][0] = inside[y][1] = 0;
        for (int32_t x = 0; x < GRID_SIZE; x++) {
            int32_t const u = at.u[2 * x], v = at.v[2 * x];
            uint64_t const bit = u >= 0 && u <= right && v >= 0 && v <= low;
            inside[y][x >> 6] |= bit << (x & 63);
        }
    }
}

void KERNEL(view_grey)(const view_planes *in, int32_t begin, int32_t end, uint8_t *grey)
{
    const uint8_t *const r = in->channel[0], *const g = in->channel[1], *const b = in->channel[2];
    if (in->channels == 1)
        memmove(grey + begin * VIEW_SIZE, r + begin * VIEW_SIZE, (size_t)((end - begin) * VIEW_SIZE));
    else
        for (int32_t i = begin * VIEW_SIZE; i < end * VIEW_SIZE; i += VIEW_SIZE)
            KERNEL_LANES for (int32_t x = i; x < i + VIEW_SIZE; x++) grey[x] =
                (uint8_t)((77 * r[x] + 150 * g[x] + 29 * b[x] + 128) >> 8);
}
