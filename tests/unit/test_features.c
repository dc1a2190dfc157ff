/* Maps of one frame: foreground, edges and local contrast of pictures for which they are known. */
#include "api/kernels.h"
#include "image/features.h"

#include "base/arena.h"
#include "base/base.h"
#include "base/rng.h"
#include "toy_features.h"

#include "check.h"

enum { MEMORY = 8 << 20 };

static const kernels *run;
static features f;
static features_scratch scratch;
static view_planes frame, plate;
static uint8_t grey[VIEW_PIXELS];

static void make_maps(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[MEMORY];
    arena a = {.base = memory, .cap = sizeof memory};
    f = features_layout(&a);
    scratch = features_scratch_layout(&a);
    frame = view_planes_layout(&a, 3);
    plate = view_planes_layout(&a, 3);
    CHECK(!a.overflow);
}

static uint32_t noise(uint32_t i)
{
    uint32_t r[4];
    rng_bits(4, 0, 0, i / 4, 0, r);
    return r[i % 4];
}

/* A plate with texture in every channel, well inside the range; the frame equals it. */
static void make_scene(int32_t channels)
{
    frame.channels = plate.channels = channels;
    for (int32_t c = 0; c < channels; c++) {
        for (int32_t i = 0; i < VIEW_PIXELS; i++)
            plate.channel[c][i] =
                (uint8_t)(60 + 20 * c + (int32_t)(noise((uint32_t)(i / 4 + c * VIEW_PIXELS)) % 90));
        memcpy(frame.channel[c], plate.channel[c], VIEW_PIXELS);
    }
    memset(f.inside, 0xff, GRID_SIZE * sizeof *f.inside);
}

/* Foreground of a cell from its bit planes, [0, FOREGROUND_ONE]. */
static int32_t fg_at(int32_t x, int32_t y)
{
    int32_t p = 0;
    for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
        p |= (int32_t)(f.foreground[k][y][x >> 6] >> (x & 63) & 1) << k;
    return p;
}

/* ---- foreground ---- */
static void test_no_change(void)
{
    for (int32_t channels = 1; channels <= 3; channels += 2) {
        make_scene(channels);
        memset(f.foreground, 0xff, FOREGROUND_PLANES * sizeof *f.foreground); /* of the frame before */
        run->features_foreground(&f, &frame, &plate);
        int32_t set = 0;
        for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
            for (int32_t y = 0; y < GRID_SIZE; y++)
                set += f.foreground[k][y][0] != 0 || f.foreground[k][y][1] != 0;
        CHECK(f.foreground_total == 0 && set == 0);
    }
}

/* If the whole frame is brighter or darker by an eighth, it is the same scene. */
static void test_exposure(void)
{
    for (int32_t channels = 1; channels <= 3; channels += 2)
        for (int32_t gain = 14; gain <= 18; gain += 2) {
            make_scene(channels);
            for (int32_t c = 0; c < channels; c++)
                for (int32_t i = 0; i < VIEW_PIXELS; i++)
                    frame.channel[c][i] = (uint8_t)(plate.channel[c][i] * gain / 16);
            run->features_foreground(&f, &frame, &plate);
            CHECK(f.foreground_total < GRID_SIZE * GRID_SIZE * FOREGROUND_ONE / 200);
        }
}

/* Something stands in cells [40, 70) x [50, 90): foreground there, nowhere else. */
static void test_square(void)
{
    static const int32_t lift[][3] = {{70, 70, 70}, {-55, -55, -55}, {60, -30, 0}};
    for (size_t k = 0; k < 4; k++) {
        int32_t const channels = k < 3 ? 3 : 1;
        int32_t inside = 0, outside = 0, total = 0;
        make_scene(channels);
        for (int32_t c = 0; c < channels; c++)
            for (int32_t y = 100; y < 180; y++)
                for (int32_t x = 80; x < 140; x++)
                    frame.channel[c][y * VIEW_SIZE + x] =
                        (uint8_t)(plate.channel[c][y * VIEW_SIZE + x] + lift[k % 3][c]);
        for (int32_t c = 0; c < channels; c++) /* and the light falls a little */
            for (int32_t i = 0; i < VIEW_PIXELS; i++)
                frame.channel[c][i] = (uint8_t)(frame.channel[c][i] * 31 / 32);
        run->features_foreground(&f, &frame, &plate);
        for (int32_t y = 0; y < GRID_SIZE; y++)
            for (int32_t x = 0; x < GRID_SIZE; x++) {
                bool const in = x >= 40 && x < 70 && y >= 50 && y < 90;
                *(in ? &inside : &outside) += fg_at(x, y);
                total += fg_at(x, y);
            }
        CHECK(total == f.foreground_total);
        CHECK(inside > 30 * 40 * FOREGROUND_ONE * 3 / 4);
        CHECK(outside < 200);
    }
}

/* A grey image gives the same foreground as the same image in three equal channels, where it grew brighter. */
static void test_channels(void)
{
    int32_t total[2];
    for (int32_t k = 0; k < 2; k++) {
        make_scene(1);
        for (int32_t i = 100 * VIEW_SIZE; i < 130 * VIEW_SIZE; i++)
            frame.channel[0][i] = (uint8_t)(plate.channel[0][i] + 14 + i % 8);
        for (int32_t c = 1; c < 3; c++) {
            memcpy(frame.channel[c], frame.channel[0], VIEW_PIXELS);
            memcpy(plate.channel[c], plate.channel[0], VIEW_PIXELS);
        }
        frame.channels = plate.channels = k ? 3 : 1;
        run->features_foreground(&f, &frame, &plate);
        total[k] = f.foreground_total;
    }
    CHECK(total[0] == total[1] && total[0] > 15 * GRID_SIZE * FOREGROUND_ONE / 2);
}

/* A shadow keeps the colour of what it falls on: it counts less than paint of the same distance. */
static void test_shadow(void)
{
    int32_t total[2];
    for (int32_t painted = 0; painted < 2; painted++) {
        make_scene(3);
        for (int32_t c = 0; c < 3; c++)
            for (int32_t y = 0; y < 16; y++)
                for (int32_t x = 0; x < VIEW_SIZE; x++) {
                    int32_t const i = y * VIEW_SIZE + x, b = plate.channel[c][i], dark = 3 * b / 16;
                    frame.channel[c][i] = (uint8_t)(painted && c == 1 ? b + dark : b - dark);
                }
        run->features_foreground(&f, &frame, &plate);
        total[painted] = 0;
        for (int32_t y = 0; y < 8; y++)
            for (int32_t x = 0; x < GRID_SIZE; x++)
                total[painted] += fg_at(x, y);
    }
    CHECK(total[0] > 0 && 4 * total[0] < 3 * total[1]);
}

/* Cells that the camera does not see are never foreground. */
static void test_unseen(void)
{
    int32_t outside = 0;
    make_scene(1);
    memset(frame.channel[0], 255, VIEW_PIXELS);
    for (int32_t y = 0; y < GRID_SIZE; y++) {
        f.inside[y][0] = y < 100 ? ~UINT64_C(0) << 20 : 0;
        f.inside[y][1] = 0;
    }
    run->features_foreground(&f, &frame, &plate);
    for (int32_t y = 0; y < GRID_SIZE; y++)
        for (int32_t x = 0; x < GRID_SIZE; x++)
            outside += fg_at(x, y) > 0 && !(x >= 20 && x < 64 && y < 100);
    CHECK(outside == 0 && f.foreground_total > 100 * 44 * FOREGROUND_ONE / 2);
}

/* ---- edges ---- */

/* A straight step through (cx, cy) with normal at an angle, anti-aliased by its distance. */
static void make_step(double cx, double cy, double angle, double low, double high)
{
    for (int32_t y = 0; y < VIEW_SIZE; y++)
        for (int32_t x = 0; x < VIEW_SIZE; x++) {
            double const d = (x - cx) * cos(angle) + (y - cy) * sin(angle);
            double const t = fmin(fmax(d + 0.5, 0.0), 1.0);
            grey[y * VIEW_SIZE + x] = (uint8_t)(low + t * (high - low) + 0.5);
        }
}

/* n'Tn for a normal at an angle, 1 at most. */
static double response(const edge_cell *e, double angle)
{
    return (e->trace + e->xx_yy * cos(2.0 * angle) + e->xy2 * sin(2.0 * angle)) / (2.0 * EDGE_ONE);
}

static void test_edges(void)
{
    static const double height[] = {150.0, 70.0, 40.0};
    double along[3];
    for (int k = 0; k < 3; k++) {
        double least = 1.0, most = 0.0, across = 0.0, off = 0.0;
        for (int step = 0; step < 24; step++) {
            double const angle = 6.283185307 * step / 24.0;
            make_step(128.0, 120.0, angle, 60.0, 60.0 + height[k]);
            run->features_edges(grey, f.edge, scratch.rows);
            const edge_cell *const e = &f.edge[120 * VIEW_SIZE + 128];
            least = fmin(least, response(e, angle));
            most = fmax(most, response(e, angle));
            across = fmax(across, response(e, angle + 1.570796327));
            int32_t const x = 128 + (int32_t)(12.0 * cos(angle)), y = 120 + (int32_t)(12.0 * sin(angle));
            off = fmax(off, response(&f.edge[y * VIEW_SIZE + x], angle));
        }
        CHECK(least > 0.5 && most <= 1.0 && most - least < 0.2);
        CHECK(across < 0.06);
        CHECK(off < 0.05);
        along[k] = least;
    }
    CHECK(along[2] > 0.65 * along[0]); /* hardly depends on the height of the step */
}

/* Among many strong edges one edge counts less than alone. */
static void test_edges_crowd(void)
{
    double have[2];
    for (int32_t stripes = 0; stripes < 2; stripes++) {
        for (int32_t y = 0; y < VIEW_SIZE; y++)
            for (int32_t x = 0; x < VIEW_SIZE; x++)
                grey[y * VIEW_SIZE + x] = (stripes ? x / 5 % 2 : x >= 125) ? 60 : 160;
        run->features_edges(grey, f.edge, scratch.rows);
        have[stripes] = response(&f.edge[120 * VIEW_SIZE + 125], 0.0);
    }
    CHECK(have[1] > 0.2 && have[1] < 0.85 * have[0]);
}

/* No structure, no edges; noise gives no direction on average. */
static void test_edges_none(void)
{
    int32_t any = 0;
    double trace = 0.0, xx_yy = 0.0, xy2 = 0.0;
    memset(grey, 200, sizeof grey);
    run->features_edges(grey, f.edge, scratch.rows);
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        any += f.edge[i].trace != 0 || f.edge[i].xx_yy != 0 || f.edge[i].xy2 != 0;
    CHECK(any == 0);
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        grey[i] = (uint8_t)(noise((uint32_t)i) >> 24);
    run->features_edges(grey, f.edge, scratch.rows);
    int32_t wrong = 0;
    for (int32_t i = 0; i < VIEW_PIXELS; i++) {
        const edge_cell *const e = &f.edge[i];
        double const size = sqrt((double)(e->xx_yy * e->xx_yy + e->xy2 * e->xy2));
        wrong += e->trace < 0 || e->trace > EDGE_ONE || size > e->trace + 3.0; /* positive semidefinite */
        trace += e->trace;
        xx_yy += e->xx_yy;
        xy2 += e->xy2;
    }
    CHECK(wrong == 0);
    CHECK(trace / VIEW_PIXELS > 10.0);
    CHECK_NEAR(xx_yy / trace, 0.0, 0.02);
    CHECK_NEAR(xy2 / trace, 0.0, 0.02);
}

/* ---- contrast ---- */
static void test_contrast(void)
{
    static int8_t plain[VIEW_PIXELS], changed[VIEW_PIXELS];
    static uint8_t other[VIEW_PIXELS];
    for (int32_t y = 0; y < VIEW_SIZE; y++) /* blocks of 3 x 3, sd about 35 */
        for (int32_t x = 0; x < VIEW_SIZE; x++)
            grey[y * VIEW_SIZE + x] = (uint8_t)(60 + noise((uint32_t)(y / 3 * 100 + x / 3)) % 121);
    run->features_contrast(grey, plain);
    double sum = 0.0, square = 0.0;
    for (int32_t i = 0; i < VIEW_PIXELS; i++) {
        sum += plain[i];
        square += plain[i] * plain[i];
    }
    CHECK_NEAR(sum / VIEW_PIXELS, 0.0, 1.0);
    CHECK_NEAR(sqrt(square / VIEW_PIXELS), CONTRAST_UNIT, 2.0);
    static const double gain[] = {1.0, 0.6, 1.3}, shift[] = {60.0, 80.0, -60.0};
    for (int k = 0; k < 3; k++) {
        double worst = 0.0, ratio = 0.0;
        for (int32_t i = 0; i < VIEW_PIXELS; i++)
            other[i] = (uint8_t)(gain[k] * grey[i] + shift[k] + 0.5);
        run->features_contrast(other, changed);
        for (int32_t i = 0; i < VIEW_PIXELS; i++) {
            worst = fmax(worst, fabs((double)(changed[i] - plain[i])));
            ratio += (double)(changed[i] * plain[i]) / square;
        }
        CHECK_NEAR(ratio, 1.0, 0.04);
        CHECK(worst < 6.0);
    }
    memset(grey, 77, sizeof grey);
    run->features_contrast(grey, plain);
    int32_t any = 0;
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        any += plain[i] != 0;
    CHECK(any == 0);
    grey[100 * VIEW_SIZE + 100] = 255; /* lone pixels saturate, never wrap, never look hidden */
    grey[150 * VIEW_SIZE + 150] = 0;
    run->features_contrast(grey, plain);
    CHECK(plain[100 * VIEW_SIZE + 100] == 127 && plain[150 * VIEW_SIZE + 150] == -127);
}

/* The box is a square about the pixel, and the image's border is replicated: at borders, corners and inside. */
static void test_contrast_box(void)
{
    enum { RADIUS = 9, AREA = (2 * RADIUS + 1) * (2 * RADIUS + 1) };
    static const int32_t place[] = {0, 1, 8, 9, 10, 100, 245, 246, 247, 254, 255};
    enum { PLACES = sizeof place / sizeof *place };
    static int8_t out[VIEW_PIXELS];
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        grey[i] = (uint8_t)(noise((uint32_t)i) % (1 + noise((uint32_t)(i >> 12)) % 255));
    run->features_contrast(grey, out);
    int32_t wrong = 0;
    for (int32_t n = 0; n < PLACES * PLACES; n++) {
        int32_t const x = place[n % PLACES], y = place[n / PLACES];
        double sum = 0.0, square = 0.0;
        for (int32_t k = 0; k < AREA; k++) {
            int32_t const u = i_clamp(x + k % (2 * RADIUS + 1) - RADIUS, 0, VIEW_SIZE - 1);
            int32_t const v = i_clamp(y + k / (2 * RADIUS + 1) - RADIUS, 0, VIEW_SIZE - 1);
            sum += grey[v * VIEW_SIZE + u];
            square += (double)grey[v * VIEW_SIZE + u] * grey[v * VIEW_SIZE + u];
        }
        double const mean = sum / AREA, sd = sqrt(square / AREA - mean * mean + 36.0);
        double const z = (grey[y * VIEW_SIZE + x] - mean) * CONTRAST_UNIT / sd;
        wrong += fabs(out[y * VIEW_SIZE + x] - fmin(fmax(z, -127.0), 127.0)) > 1.01;
    }
    CHECK(wrong == 0);
}

/* ---- all together ---- */
static void test_compute(void)
{
    enum { W = 150, H = 140 }; /* smaller than the region: the person stands partly outside */
    static uint8_t pixels[W * H * 3];
    gait_camera const cam = {
        .width = W, .height = H, .fx = 200, .fy = 200, .cx = 75, .cy = 70, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    gait_image im = {.data = pixels, .width = W, .height = H, .stride = W, .format = GAIT_GREY8};
    for (int32_t i = 0; i < W * H * 3; i++)
        pixels[i] = (uint8_t)(noise((uint32_t)(i / 3)) % 251);
    f.map = (view_map){.scale = 1.0f, .u0 = -100.0f, .v0 = -50.0f};
    view_sample(run, &f.map, &cam, &im, &plate);
    toy_features(run, &f, &cam, &im, &plate, false, &scratch);
    CHECK(f.has_image && f.has_foreground && f.foreground_total == 0);
    CHECK(memcmp(scratch.planes.channel[0], plate.channel[0], VIEW_PIXELS) ==
          0); /* in bands as in one piece */
    int32_t cells = 0;
    for (int32_t y = 0; y < GRID_SIZE; y++)
        cells += grid_popcount(f.inside[y][0]) + grid_popcount(f.inside[y][1]);
    CHECK(cells == W / 2 * (H / 2));
    CHECK(f.edge[20 * VIEW_SIZE + 20].trace == 0 && f.edge[120 * VIEW_SIZE + 180].trace > 5);
    toy_features(run, &f, &cam, &im, NULL, true, &scratch); /* no plate; grey levels in paper mode */
    CHECK(f.has_image && !f.has_foreground);
    int32_t wrong = 0;
    for (int32_t y = 0; y < H; y++)
        for (int32_t x = 0; x < W; x++)
            wrong += scratch.surface[(y + 50) * VIEW_SIZE + x + 100] != i_max(pixels[y * W + x] - 128, -127);
    CHECK(wrong == 0);
    im.format = GAIT_RGB8;
    im.stride = 3 * W;
    toy_features(run, &f, &cam, &im, &plate, false, &scratch); /* a grey plate: its luma is compared */
    CHECK(f.has_image && f.has_foreground && f.foreground_total > 0);
    im.data = NULL;
    f.has_foreground = true;
    toy_features(run, &f, &cam, &im, &plate, false, &scratch);
    CHECK(!f.has_image && !f.has_foreground);
}

int main(void)
{
    run = kernels_choose(~0u); /* the others give the same: test_image_kernels.c */
    make_maps();
    test_no_change();
    test_exposure();
    test_square();
    test_channels();
    test_shadow();
    test_unseen();
    test_edges();
    test_edges_crowd();
    test_edges_none();
    test_contrast();
    test_contrast_box();
    test_compute();
    return CHECK_DONE();
}
