/* The region of interest: how it follows the person, and from where its pixels are resampled. */
#include "image/view.h"

#include "image/camera.h"
#include "api/kernels.h"
#include "raster/rast.h"
#include "base/rng.h"

#include "check.h"

#include <stdlib.h>

enum { MOST = 640 };

static const kernels *run;
static uint8_t plane[3][VIEW_PIXELS];
static view_planes planes = {.channel = {plane[0], plane[1], plane[2]}, .channels = 3};
static uint8_t pixels[MOST * MOST * 3];

static gait_camera camera(int32_t width, int32_t height)
{
    return (gait_camera){.width = width,
                         .height = height,
                         .fx = 300.0f,
                         .fy = 310.0f,
                         .cx = 0.5f * (float)width,
                         .cy = 0.5f * (float)height,
                         .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

static gait_image grey_image(int32_t width, int32_t height, int32_t stride)
{
    return (gait_image){
        .data = pixels, .width = width, .height = height, .stride = stride, .format = GAIT_GREY8};
}

static void fill_random(void)
{
    for (uint32_t i = 0; i < sizeof pixels; i += 16) {
        uint32_t r[4];
        rng_bits(1, 0, 0, i, 0, r);
        memcpy(pixels + i, r, sizeof r);
    }
}

/* ---- follow ---- */
static void test_follow(void)
{
    view_map map = {0};
    const float uv[2] = {320.0f, 200.0f};
    CHECK(view_follow(&map, uv, 384.0f));
    CHECK(map.scale == 0.5f); /* VIEW_PERSON / 384 */
    CHECK_NEAR((uv[0] - map.u0) * map.scale, 127.5, 1e-4);
    CHECK_NEAR((uv[1] - map.v0) * map.scale, 127.5, 1e-4);
    view_map const first = map;
    static const float calm[][3] = {{18, 0, 384}, {-18, 18, 384}, {0, -18, 384}, {0, 0, 400}, {0, 0, 366}};
    for (size_t k = 0; k < sizeof calm / sizeof *calm; k++) {
        const float to[2] = {uv[0] + calm[k][0], uv[1] + calm[k][1]};
        CHECK(!view_follow(&map, to, calm[k][2]) && memcmp(&map, &first, sizeof map) == 0);
    }
    static const float moved[][3] = {{22, 0, 384},  {-22, 0, 384}, {0, 22, 384},
                                     {0, -22, 384}, {0, 0, 412},   {0, 0, 356}};
    for (size_t k = 0; k < sizeof moved / sizeof *moved; k++) {
        const float to[2] = {uv[0] + moved[k][0], uv[1] + moved[k][1]};
        map = first;
        CHECK(view_follow(&map, to, moved[k][2]));
        CHECK_NEAR(map.scale, 192.0 / (double)moved[k][2], 1e-6);
        CHECK_NEAR((to[0] - map.u0) * map.scale, 127.5, 1e-3);
        CHECK_NEAR((to[1] - map.v0) * map.scale, 127.5, 1e-3);
    }
    /* A person coming nearer in small steps is followed: the region stays within its slack. */
    for (int i = 0; i < 200; i++) {
        float const tall = 100.0f * powf(1.01f, (float)i);
        view_follow(&map, uv, tall);
        CHECK_NEAR(map.scale * f_clamp(tall, 96.0f, 6144.0f), 192.0, 12.0);
    }
    static const float extreme[] = {0.0f, -5.0f, NAN, 1e9f,
                                    INFINITY}; /* no size is refused, none overflows */
    for (size_t k = 0; k < sizeof extreme / sizeof *extreme; k++) {
        map = (view_map){0};
        CHECK(view_follow(&map, uv, extreme[k]));
        CHECK(map.scale == (extreme[k] > 1e6f ? 1.0f / 32.0f : 2.0f) && isfinite(map.u0));
    }
}

/* ---- sampling ---- */

/* Scale 1 copies; what lies outside repeats the border. */
static void test_copy(void)
{
    enum { W = 300, H = 200, STRIDE = 311 };
    gait_camera const cam = camera(W, H);
    gait_image im = grey_image(W, H, STRIDE);
    fill_random();
    static const float origin[][2] = {{0, 0}, {-40, -17}, {100, 30}, {-1000, 5}, {900, 900}};
    for (size_t k = 0; k < sizeof origin / sizeof *origin; k++) {
        view_map const map = {.scale = 1.0f, .u0 = origin[k][0], .v0 = origin[k][1]};
        int32_t wrong = 0;
        view_sample(run, &map, &cam, &im, &planes);
        for (int32_t j = 0; j < VIEW_SIZE; j++)
            for (int32_t i = 0; i < VIEW_SIZE; i++) {
                int32_t const x = i_clamp((int32_t)map.u0 + i, 0, W - 1);
                int32_t const y = i_clamp((int32_t)map.v0 + j, 0, H - 1);
                wrong += plane[0][j * VIEW_SIZE + i] != pixels[y * STRIDE + x];
            }
        CHECK(wrong == 0 && planes.channels == 1);
    }
}

/* Three channels are not mixed. */
static void test_colour(void)
{
    enum { W = 260, H = 258, STRIDE = 3 * W + 5 };
    static const float scale[] = {1.0f, 0.5f, 0.25f};
    gait_camera const cam = camera(W, H);
    gait_image im = grey_image(W, H, STRIDE);
    for (int32_t i = 0; i < H * STRIDE; i++)
        pixels[i] = (uint8_t)(50 + 70 * (i % STRIDE % 3));
    for (size_t k = 0; k < 6; k++) {
        bool const bgr = k >= 3; /* planes are R, G, B all the same */
        im.format = bgr ? GAIT_BGR8 : GAIT_RGB8;
        view_map const map = {.scale = scale[k % 3], .u0 = 0.3f, .v0 = 0.7f};
        int32_t wrong = 0;
        view_sample(run, &map, &cam, &im, &planes);
        for (int32_t c = 0; c < 3; c++)
            for (int32_t i = 0; i < VIEW_PIXELS; i++)
                wrong += plane[c][i] != 50 + 70 * (bgr ? 2 - c : c);
        CHECK(wrong == 0 && planes.channels == 3);
    }
}

/* A ramp of grey levels is resampled to the same ramp at every scale: nothing is shifted. */
static void test_ramp(void)
{
    static const float scales[] = {2.0f, 1.37f, 1.0f, 0.83f, 0.61f, 0.47f, 0.31f, 0.24f};
    gait_camera const cam = camera(MOST, MOST);
    gait_image const im = grey_image(MOST, MOST, MOST);
    for (int32_t y = 0; y < MOST; y++)
        for (int32_t x = 0; x < MOST; x++)
            pixels[y * MOST + x] = (uint8_t)(20.5 + 0.2 * x + 0.13 * y);
    for (size_t k = 0; k < sizeof scales / sizeof *scales; k++) {
        view_map const map = {.scale = scales[k], .u0 = 20.4f, .v0 = 31.3f};
        double sum = 0.0, worst = 0.0;
        int32_t n = 0;
        view_sample(run, &map, &cam, &im, &planes);
        for (int32_t j = 0; j < VIEW_SIZE; j++)
            for (int32_t i = 0; i < VIEW_SIZE; i++) {
                double const u = (double)map.u0 + i / (double)map.scale;
                double const v = (double)map.v0 + j / (double)map.scale;
                if (u > MOST - 10 || v > MOST - 10)
                    continue;
                double const d = plane[0][j * VIEW_SIZE + i] - (20.0 + 0.2 * u + 0.13 * v);
                sum += d;
                worst = fmax(worst, fabs(d));
                n++;
            }
        CHECK(n > 10000);
        CHECK_NEAR(sum / n, 0.0, 0.05);
        CHECK(worst < 1.3);
    }
}

/* Coarser working images average a box of pixels: noise falls with the number of pixels, and so does aliasing. */
static void test_average(void)
{
    gait_camera const cam = camera(MOST, MOST);
    gait_image const im = grey_image(MOST, MOST, MOST);
    for (int32_t i = 0; i < MOST * MOST; i++)
        pixels[i] = (i % MOST + i / MOST) % 2 ? 255 : 0;
    view_map const half = {.scale = 0.5f, .u0 = 3.0f, .v0 = 3.0f}, quarter = {.scale = 0.25f};
    int32_t wrong = 0;
    view_sample(run, &half, &cam, &im, &planes);
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        wrong += plane[0][i] != 128;
    view_sample(run, &quarter, &cam, &im, &planes);
    for (int32_t j = 0; j < 150; j++)
        for (int32_t i = 0; i < 150; i++)
            wrong += plane[0][j * VIEW_SIZE + i] != 128;
    CHECK(wrong == 0);
}

/* Any map and any frame, however small: only pixels of the frame are read (the sanitizer watches). */
static void test_small(void)
{
    static const int32_t sizes[][2] = {{1, 1}, {1, 7}, {9, 1}, {2, 2}, {5, 300}};
    static const float scales[] = {2.0f, 1.0f, 0.4f, 1.0f / 32.0f};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        int32_t const w = sizes[k][0], h = sizes[k][1];
        uint8_t *const data = malloc((size_t)(w * h));
        gait_image im = grey_image(w, h, w);
        gait_camera cam = camera(w, h);
        if (!data)
            abort();
        im.data = data;
        memset(data, 99, (size_t)(w * h));
        for (size_t s = 0; s < 8; s++) {
            view_map const map = {
                .scale = scales[s % 4], .u0 = s % 3 ? -3.5f : 1e9f, .v0 = s % 2 ? 2.5f : -1e9f};
            int32_t wrong = 0;
            cam.distortion[0] = s < 4 ? 0.0f : 1e6f;
            view_sample(run, &map, &cam, &im, &planes);
            for (int32_t i = 0; i < VIEW_PIXELS; i++)
                wrong += plane[0][i] != 99;
            CHECK(wrong == 0);
        }
        free(data);
    }
}

/* ---- distortion ---- */

/* Ideal pixel seen at a captured pixel: fixed-point inverse in double precision. */
static void undistort(const gait_camera *c, double u, double v, double ideal[2])
{
    double const xd = (u - (double)c->cx) / (double)c->fx, yd = (v - (double)c->cy) / (double)c->fy;
    const float *const k = c->distortion;
    double x = xd, y = yd;
    for (int i = 0; i < 60; i++) {
        double const r2 = x * x + y * y;
        double const radial = 1.0 + r2 * ((double)k[0] + r2 * ((double)k[1] + r2 * (double)k[4]));
        double const dx = 2.0 * (double)k[2] * x * y + (double)k[3] * (r2 + 2.0 * x * x);
        double const dy = (double)k[2] * (r2 + 2.0 * y * y) + 2.0 * (double)k[3] * x * y;
        x = (xd - dx) / radial;
        y = (yd - dy) / radial;
    }
    ideal[0] = (double)c->fx * x + (double)c->cx;
    ideal[1] = (double)c->fy * y + (double)c->cy;
}

/* Where the dark line's middle is in a column of the working image; -1: no line. */
static double line_row(int32_t column)
{
    double sum = 0.0, weight = 0.0;
    for (int32_t j = 0; j < VIEW_SIZE; j++) {
        double const dark = 200.0 - plane[0][j * VIEW_SIZE + column];
        sum += dark * j;
        weight += dark;
    }
    return weight > 300.0 ? sum / weight : -1.0;
}

/* A straight line, captured through a lens that bends it, is straight in the working image. */
static void test_line(void)
{
    static const float lens[][5] = {
        {-0.25f, 0.08f, 0, 0, 0}, {0.2f, 0, 0, 0, 0}, {-0.1f, 0, 0.01f, -0.008f, 0.02f}};
    enum { W = 480, H = 400 };
    gait_image const im = grey_image(W, H, W);
    for (size_t k = 0; k < 4; k++) {
        gait_camera cam = camera(W, H);
        double worst = 0.0, bent = 0.0;
        int32_t columns = 0;
        if (k < 3)
            memcpy(cam.distortion, lens[k], sizeof lens[k]);
        for (int32_t y = 0; y < H; y++)
            for (int32_t x = 0; x < W; x++) {
                double ideal[2];
                undistort(&cam, x, y, ideal);
                double const off = fabs(ideal[1] - (60.0 + 0.12 * ideal[0])); /* the line */
                pixels[y * W + x] = (uint8_t)(200.0 - fmax(0.0, 40.0 * (3.0 - off)));
            }
        view_map const map = {.scale = 0.9f, .u0 = 90.0f, .v0 = 10.0f};
        view_sample(run, &map, &cam, &im, &planes);
        for (int32_t i = 0; i < VIEW_SIZE; i++) {
            double const u = (double)map.u0 + i / (double)map.scale;
            double const want = (60.0 + 0.12 * u - (double)map.v0) * (double)map.scale, have = line_row(i);
            columns += have >= 0.0;
            worst = fmax(worst, fabs(have - want));
            float ud, vd;
            camera_distort(&cam, (float)u, 60.0f + 0.12f * (float)u, &ud, &vd);
            bent = fmax(bent, fabs((double)vd - 60.0 - 0.12 * u));
        }
        CHECK(columns == VIEW_SIZE);
        CHECK(worst < 0.3);
        CHECK(k == 3 ? bent < 1e-3 : bent > 3.0); /* the capture was bent by pixels */
    }
}

/* ---- what the camera sees ---- */
static void test_inside(void)
{
    enum { W = 200, H = 120 };
    gait_camera cam = camera(W, H);
    static const view_map maps[] = {
        {1.0f, 0, 0}, {0.5f, -100, -60}, {2.0f, 150.3f, 80.6f}, {1.0f, -300, 0}, {0.8f, -31.7f, 70.2f}};
    for (int bent = 0; bent < 2; bent++)
        for (size_t k = 0; k < sizeof maps / sizeof *maps; k++) {
            uint64_t inside[GRID_SIZE][2];
            int32_t wrong = 0, count = 0;
            cam.distortion[0] = bent ? 0.15f : 0.0f;
            run->view_inside(&maps[k], &cam, inside);
            for (int32_t y = 0; y < GRID_SIZE; y++)
                for (int32_t x = 0; x < GRID_SIZE; x++) {
                    float u = maps[k].u0 + 2.0f * (float)x / maps[k].scale;
                    float v = maps[k].v0 + 2.0f * (float)y / maps[k].scale;
                    camera_distort(&cam, u, v, &u, &v);
                    bool const in = u >= 0 && u <= W - 1 && v >= 0 && v <= H - 1;
                    bool const close = fabsf(u) < 0.02f || fabsf(u - W + 1) < 0.02f || fabsf(v) < 0.02f ||
                                       fabsf(v - H + 1) < 0.02f;
                    count += in;
                    wrong += !close && in != (inside[y][x >> 6] >> (x & 63) & 1);
                }
            CHECK(wrong == 0);
            CHECK(k == 3 ? count == 0 : count > 100);
        }
}

static void test_grey(void)
{
    static uint8_t grey[VIEW_PIXELS];
    fill_random();
    for (int32_t c = 0; c < 3; c++)
        memcpy(plane[c], pixels + c * VIEW_PIXELS, VIEW_PIXELS);
    planes.channels = 3;
    double worst = 0.0;
    run->view_grey(&planes, 0, VIEW_SIZE, grey);
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        worst =
            fmax(worst, fabs(grey[i] - (0.299 * plane[0][i] + 0.587 * plane[1][i] + 0.114 * plane[2][i])));
    CHECK(worst < 1.5);
    planes.channels = 1;
    run->view_grey(&planes, 0, VIEW_SIZE, grey);
    CHECK(memcmp(grey, plane[0], sizeof grey) == 0);
}

int main(void)
{
    run = kernels_choose(~0u); /* the others give the same: test_image_kernels.c */
    test_follow();
    test_copy();
    test_colour();
    test_ramp();
    test_average();
    test_small();
    test_line();
    test_inside();
    test_grey();
    return CHECK_DONE();
}
