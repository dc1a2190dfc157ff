#include "features.h"
#include "base.h"
#include <string.h>

features features_layout(arena *a)
{
    features f = {0};
    f.edge = TAKE(a, edge_cell, VIEW_PIXELS);
    f.surface = TAKE(a, int8_t, VIEW_PIXELS);
    f.fg = (uint64_t (*)[RAST_SIZE][RAST_WORDS])arena_take(a, sizeof *f.fg, FG_PLANES);
    f.inside = (uint64_t (*)[RAST_WORDS])arena_take(a, sizeof *f.inside, RAST_SIZE);
    return f;
}

features_scratch features_scratch_layout(arena *a)
{
    features_scratch s;
    s.planes = view_planes_layout(a, 3);
    s.grey = TAKE(a, uint8_t, VIEW_PIXELS);
    s.gx = TAKE(a, int16_t, VIEW_PIXELS);
    s.gy = TAKE(a, int16_t, VIEW_PIXELS);
    s.sum = TAKE(a, int32_t, VIEW_PIXELS);
    s.tmp = TAKE(a, int32_t, VIEW_PIXELS);
    s.tensor = TAKE(a, int16_t, 3 * VIEW_PIXELS);
    return s;
}

/* One dimension of the box: n values `step` apart. */
static void box_line(const int32_t *in, int32_t *out, int32_t n, int32_t step, int32_t radius)
{
    int32_t sum = (radius + 1) * in[0];
    for (int32_t i = 1; i <= radius; i++)
        sum += in[i_min(i, n - 1) * step];
    for (int32_t i = 0; i < n; i++) {
        out[i * step] = sum;
        sum += in[i_min(i + radius + 1, n - 1) * step] - in[i_max(i - radius, 0) * step];
    }
}

/* All columns at once, row by row: the memory is walked in order. */
static void box_columns(const int32_t *in, int32_t *out, int32_t radius)
{
    int32_t sum[VIEW_SIZE];
    for (int32_t x = 0; x < VIEW_SIZE; x++)
        sum[x] = (radius + 1) * in[x];
    for (int32_t y = 1; y <= radius; y++)
        for (int32_t x = 0; x < VIEW_SIZE; x++)
            sum[x] += in[y * VIEW_SIZE + x];
    for (int32_t y = 0; y < VIEW_SIZE; y++) {
        const int32_t *const add = in + i_min(y + radius + 1, VIEW_SIZE - 1) * VIEW_SIZE;
        const int32_t *const sub = in + i_max(y - radius, 0) * VIEW_SIZE;
        for (int32_t x = 0; x < VIEW_SIZE; x++) {
            out[y * VIEW_SIZE + x] = sum[x];
            sum[x] += add[x] - sub[x];
        }
    }
}

void features_box(const int32_t *in, int32_t *out, int32_t radius, int32_t *tmp)
{
    for (int32_t y = 0; y < VIEW_SIZE; y++)
        box_line(in + y * VIEW_SIZE, tmp + y * VIEW_SIZE, VIEW_SIZE, 1, radius);
    box_columns(tmp, out, radius);
}

/* ---- foreground ------------------------------------------------------------ */

/* Exposure of the frame against the plate in 1/256, half to double, over pixels that changed little. */
static int32_t exposure_gain(const view_planes *im, const view_planes *plate)
{
    int64_t frame = 0, scene = 0, count = 0;
    for (int32_t c = 0; c < im->channels; c++)
        for (int32_t i = 0; i < VIEW_PIXELS; i++) {
            int32_t const a = im->channel[c][i], b = plate->channel[c][i], d = a - b;
            int32_t const calm = d > -32 && d < 32;
            frame += calm * a;
            scene += calm * b;
            count += calm;
        }
    /* Too few or too dark pixels say nothing of the exposure. */
    if (count < VIEW_PIXELS / 16 || scene < 8 * count)
        return 256;
    return i_clamp((int32_t)(frame * 256 / scene), 128, 512);
}

/* Evidence that one cell of 2 x 2 pixels changed, grey levels squared over three channels.  What a shadow
 * explains, the plate's colour at 2/5 .. 1 of its brightness, counts a SHADOW_SHARE-th. */
static int32_t cell_difference(const view_planes *im, const view_planes *plate, int32_t at, int32_t gain)
{
    enum { SHADOW_SHARE = 6 };
    int32_t total = 0, across = 0, scene2 = 0; /* |I - B|^2, <I, B>, <B, B> */
    for (int32_t c = 0; c < im->channels; c++) {
        const uint8_t *const a = im->channel[c] + at, *const b = plate->channel[c] + at;
        int32_t const frame = (a[0] + a[1] + a[VIEW_SIZE] + a[VIEW_SIZE + 1]) / 4;
        int32_t const scene = (b[0] + b[1] + b[VIEW_SIZE] + b[VIEW_SIZE + 1]) * gain / 1024;
        int32_t const d = frame - scene;
        total += d * d;
        across += frame * scene;
        scene2 += scene * scene;
    }
    if (im->channels == 1)
        return 3 * total;
    int32_t const ratio = 256 * across / i_max(scene2, 1); /* brightness against the plate, 1/256 */
    if (ratio < 102 || ratio >= 256)
        return total;
    /* |I - B|^2 = |I - r B|^2 + (1 - r)^2 |B|^2: colour and shade */
    int32_t const dark = 256 - ratio, shade = i_min((dark * dark / 256) * (scene2 / 16) / 16, total);
    return total - shade + shade / SHADOW_SHARE;
}

void features_foreground(features *f, const view_planes *im, const view_planes *plate)
{
    int32_t const half = 3 * 9 * 9; /* squared difference at which a cell is as likely foreground as not */
    int32_t const gain = exposure_gain(im, plate);
    memset(f->fg, 0, FG_PLANES * sizeof *f->fg);
    f->fg_total = 0;
    for (int32_t y = 0; y < RAST_SIZE; y++)
        for (int32_t x = 0; x < RAST_SIZE; x++) {
            if (!(f->inside[y][x >> 6] >> (x & 63) & 1))
                continue;
            int32_t const d = cell_difference(im, plate, 2 * y * VIEW_SIZE + 2 * x, gain);
            int32_t const p = (FG_ONE * d + (d + half) / 2) / (d + half);
            f->fg_total += p;
            for (int32_t k = 0; k < FG_PLANES; k++)
                f->fg[k][y][x >> 6] |= (uint64_t)(p >> k & 1) << (x & 63);
        }
}

/* ---- edges ------------------------------------------------------------ */

/* Gradient of the binomially smoothed image (Sobel's kernel, 8 per grey level and pixel). */
static void gradient(const uint8_t *grey, int16_t *gx, int16_t *gy)
{
    memset(gx, 0, VIEW_PIXELS * sizeof *gx);
    memset(gy, 0, VIEW_PIXELS * sizeof *gy);
    for (int32_t y = 1; y < VIEW_SIZE - 1; y++)
        for (int32_t x = 1; x < VIEW_SIZE - 1; x++) {
            const uint8_t *const p = grey + y * VIEW_SIZE + x;
            const uint8_t *const u = p - VIEW_SIZE, *const d = p + VIEW_SIZE;
            gx[y * VIEW_SIZE + x] = (int16_t)(u[1] + 2 * p[1] + d[1] - u[-1] - 2 * p[-1] - d[-1]);
            gy[y * VIEW_SIZE + x] = (int16_t)(d[-1] + 2 * d[0] + d[1] - u[-1] - 2 * u[0] - u[1]);
        }
}

/* 1-2-1 in both directions, twice: the tolerance of an edge's place, about 1.4 pixels. */
static void soften(const int16_t *in, int32_t *out, int32_t *tmp)
{
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        out[i] = in[i];
    for (int32_t pass = 0; pass < 2; pass++) {
        for (int32_t y = 0; y < VIEW_SIZE; y++)
            for (int32_t x = 0; x < VIEW_SIZE; x++) {
                const int32_t *const p = out + y * VIEW_SIZE;
                tmp[y * VIEW_SIZE + x] = p[i_max(x - 1, 0)] + 2 * p[x] + p[i_min(x + 1, VIEW_SIZE - 1)];
            }
        for (int32_t y = 0; y < VIEW_SIZE; y++) {
            const int32_t *const u = tmp + i_max(y - 1, 0) * VIEW_SIZE, *const p = tmp + y * VIEW_SIZE;
            const int32_t *const d = tmp + i_min(y + 1, VIEW_SIZE - 1) * VIEW_SIZE;
            for (int32_t x = 0; x < VIEW_SIZE; x++)
                out[y * VIEW_SIZE + x] = (u[x] + 2 * p[x] + d[x]) / 16;
        }
    }
}

/* gg'/(|g|^2 + k^2): an outer product that saturates at trace 1, k = local mean gradient and a noise
 * floor. */
static void edge_tensor(const features_scratch *s, int32_t box_area, int16_t *xx, int16_t *yy, int16_t *xy)
{
    float const floor2 = 40.0f * 40.0f; /* 5 grey levels per pixel in Sobel units */
    float const inv = 1.0f / (float)box_area;
    float const one = 8.0f * (float)EDGE_ONE;
    for (int32_t i = 0; i < VIEW_PIXELS; i++) {
        float const x = (float)s->gx[i], y = (float)s->gy[i], mean = (float)s->sum[i] * inv;
        float const k = one / (x * x + y * y + 2.0f * mean * mean + floor2);
        xx[i] = (int16_t)(x * x * k);
        yy[i] = (int16_t)(y * y * k);
        xy[i] = (int16_t)(x * y * k);
    }
}

void features_edges(const uint8_t *grey, edge_cell *out, features_scratch *s)
{
    enum { RADIUS = 12 };
    int16_t *const xx = s->tensor, *const yy = xx + VIEW_PIXELS, *const xy = yy + VIEW_PIXELS;
    gradient(grey, s->gx, s->gy);
    for (int32_t i = 0; i < VIEW_PIXELS; i++) {
        float const x = (float)s->gx[i], y = (float)s->gy[i];
        s->sum[i] = (int32_t)__builtin_sqrtf(x * x + y * y);
    }
    features_box(s->sum, s->sum, RADIUS, s->tmp);
    edge_tensor(s, (2 * RADIUS + 1) * (2 * RADIUS + 1), xx, yy, xy);
    soften(xx, s->sum, s->tmp);
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        xx[i] = (int16_t)s->sum[i];
    soften(yy, s->sum, s->tmp);
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        out[i] = (edge_cell){.trace = (int8_t)((xx[i] + s->sum[i]) / 8),
                             .xx_yy = (int8_t)((xx[i] - s->sum[i]) / 8)};
    soften(xy, s->sum, s->tmp);
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        out[i].xy2 = (int8_t)(s->sum[i] / 4);
}

/* ---- surface ------------------------------------------------------------ */

void features_contrast(const uint8_t *grey, int8_t *out, features_scratch *s)
{
    enum { RADIUS = 9, AREA = (2 * RADIUS + 1) * (2 * RADIUS + 1) };
    float const inv = 1.0f / (float)AREA, floor2 = 6.0f * 6.0f;
    int32_t *const square = (int32_t *)(void *)s->tensor; /* 6 bytes a pixel are free there, 4 are needed */
    for (int32_t i = 0; i < VIEW_PIXELS; i++) {
        s->sum[i] = grey[i];
        square[i] = grey[i] * grey[i];
    }
    features_box(s->sum, s->sum, RADIUS, s->tmp);
    features_box(square, square, RADIUS, s->tmp);
    for (int32_t i = 0; i < VIEW_PIXELS; i++) {
        float const mean = (float)s->sum[i] * inv;
        float const var = f_max((float)square[i] * inv - mean * mean, 0.0f) + floor2;
        float const z = ((float)grey[i] - mean) * ((float)CONTRAST_UNIT / __builtin_sqrtf(var));
        out[i] = (int8_t)f_clamp(z, -127.0f, 127.0f);
    }
}

void features_compute(features *f, const gait_camera *cam, const gait_image *im, const view_planes *plate,
                      bool raw, features_scratch *s)
{
    f->seen = im->data != NULL;
    f->has_fg = false;
    if (!f->seen)
        return;
    view_sample(&f->map, cam, im, &s->planes);
    view_inside(&f->map, cam, f->inside);
    view_grey(&s->planes, s->grey);
    f->has_fg = plate != NULL;
    if (f->has_fg) {
        view_planes const luma = {.channel = {s->grey}, .channels = 1};
        features_foreground(f, plate->channels == 1 ? &luma : &s->planes, plate);
    }
    features_edges(s->grey, f->edge, s);
    if (raw)
        for (int32_t i = 0; i < VIEW_PIXELS; i++)
            f->surface[i] = (int8_t)i_max(s->grey[i] - 128, -127);
    else
        features_contrast(s->grey, f->surface, s);
}
