/* The region's pixels and maps: every instruction set gives the bits of the scalar definition, and writes
 * nothing else. */
#include "kernel_check.h"

#include "image/camera.h"
#include "image/features.h"
#include "base/rng.h"

#include "check.h"

#include <stdlib.h>

enum { PLANES = 3, CASES = 40, PAIRS = VIEW_PIXELS - VIEW_SIZE };

static uint32_t noise(uint32_t i)
{
    uint32_t r[4];
    rng_bits(8, 0, 0, i / 4, 0, r);
    return r[i % 4];
}

/* Kinds of pictures: noise, the largest gradients, black and white cells, flat with little noise, a ramp. */
static void fill(uint8_t *out, size_t n, int32_t width, uint32_t kind)
{
    for (size_t i = 0; i < n; i++) {
        uint32_t const x = (uint32_t)(i % (size_t)width), y = (uint32_t)(i / (size_t)width);
        uint32_t const r = noise((uint32_t)i);
        out[i] = (uint8_t)(kind == 0   ? r
                           : kind == 1 ? (x + y) / 2 % 2 * 255
                           : kind == 2 ? (x / 9 + y / 7) % 2 * 255
                           : kind == 3 ? 100 + r % 4
                                       : x + y);
    }
}

/* ---- sampling ---- */

/* One frame in memory of exactly its size, so that the sanitizer sees every byte too many that is read. */
static void sample_case(uint32_t n)
{
    static const int32_t small[] = {1, 2, 3, 5};
    static const float scale[] = {2.0f, 1.31f, 1.0f, 0.51f, 0.5f, 0.37f, 0.21f, 0.13f, 1.0f / 16, 1.0f / 32};
    static unsigned char memory[2][PLANES * VIEW_PIXELS + 2 * GUARD];
    int32_t const w = n % 5 == 0 ? small[n / 5 % 4] : 7 + (int32_t)(noise(9 * n) % 900);
    int32_t const h = n % 7 == 0 ? small[n / 7 % 4] : 5 + (int32_t)(noise(9 * n + 1) % 700);
    int32_t const channels = n % 3 ? 3 : 1, stride = w * channels + (int32_t)(n % 4);
    size_t const bytes = (size_t)((h - 1) * stride + w * channels); /* the last row without its padding */
    uint8_t *const data = malloc(bytes);
    if (!data)
        abort();
    fill(data, bytes, stride, n % 5);
    gait_camera cam = {.width = w, .height = h, .fx = 500, .fy = 510, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    cam.cx = 0.5f * (float)w;
    cam.cy = 0.5f * (float)h;
    if (n % 2)
        memcpy(cam.distortion, (float[5]){n % 9 == 0 ? 1e6f : -0.3f, 0.1f, 0.01f, -0.02f, 0.03f},
               sizeof cam.distortion);
    gait_image const im = {.data = data,
                           .width = w,
                           .height = h,
                           .stride = stride,
                           .format = channels == 1 ? GAIT_GREY8
                                     : n % 2       ? GAIT_RGB8
                                                   : GAIT_BGR8};
    view_map map = {.scale = scale[n % 10]};
    map.u0 = (float)(noise(9 * n + 2) % 1000) * 1e-3f * (float)w - 127.5f / map.scale;
    map.v0 = (float)(noise(9 * n + 3) % 1000) * 1e-3f * (float)h - 127.5f / map.scale;
    view_planes out[2];
    static _Alignas(8) unsigned char inside[2][GRID_SIZE * GRID_WORDS * 8 + 2 * GUARD];
    for (int k = -1; k < isa_count(); k++) {
        const kernels *const run = k < 0 ? isa_scalar() : isa_at(k);
        int const to = k >= 0;
        guarded const g = guard_fill(memory[to], PLANES * VIEW_PIXELS),
                      in = guard_fill(inside[to], GRID_SIZE * GRID_WORDS * 8);
        for (int32_t c = 0; c < PLANES; c++)
            out[to].channel[c] = g.begin + c * VIEW_PIXELS;
        view_sample(run, &map, &cam, &im, &out[to]);
        run->view_inside(&map, &cam, (uint64_t (*)[2])(void *)in.begin);
        CHECK(guard_whole(&g) && guard_whole(&in) && out[to].channels == channels);
        CHECK(!to || memcmp(memory[0], memory[1], sizeof memory[0]) == 0);
        CHECK(!to || memcmp(inside[0], inside[1], sizeof inside[0]) == 0);
    }
    free(data);
}

/* ---- maps ---- */
typedef struct maps {
    unsigned char grey[VIEW_PIXELS + 2 * GUARD], edge[VIEW_PIXELS * sizeof(edge_cell) + 2 * GUARD];
    unsigned char surface[VIEW_PIXELS + 2 * GUARD],
        foreground[FOREGROUND_PLANES * GRID_SIZE * GRID_WORDS * 8 + 2 * GUARD];
    unsigned char pairs[PAIRS * sizeof(uint16_t) + 2 * GUARD];
    int32_t foreground_total;
} maps;

static void compute(const kernels *run, const view_planes *im, const view_planes *plate,
                    uint64_t (*inside)[GRID_WORDS], maps *out)
{
    static edge_rows rows;
    guarded const g[] = {guard_fill(out->grey, VIEW_PIXELS),
                         guard_fill(out->edge, VIEW_PIXELS * sizeof(edge_cell)),
                         guard_fill(out->surface, VIEW_PIXELS),
                         guard_fill(out->foreground, FOREGROUND_PLANES * GRID_SIZE * GRID_WORDS * 8),
                         guard_fill(out->pairs, PAIRS * sizeof(uint16_t))};
    features f = {.inside = inside, .foreground = (uint64_t (*)[GRID_SIZE][GRID_WORDS])(void *)g[3].begin};
    run->view_grey(im, 0, VIEW_SIZE, g[0].begin);
    run->features_edges(g[0].begin, (edge_cell *)(void *)g[1].begin, &rows);
    run->features_contrast(g[0].begin, (int8_t *)g[2].begin);
    run->features_pairs((int8_t *)g[2].begin, (uint16_t *)(void *)g[4].begin);
    run->features_foreground(&f, im, plate);
    out->foreground_total = f.foreground_total;
    for (size_t i = 0; i < sizeof g / sizeof *g; i++)
        CHECK(guard_whole(&g[i]));
}

/* A plate, and a frame that equals it except for exposure, some noise and a block. */
static void maps_case(uint32_t n)
{
    static uint8_t pixels[2 * PLANES][VIEW_PIXELS];
    static _Alignas(GAIT_ALIGN) maps want, have;
    static const int32_t gain[] = {16, 13, 19, 7, 34};
    view_planes im = {.channels = n % 3 ? 3 : 1}, plate = im;
    uint64_t inside[GRID_SIZE][GRID_WORDS];
    for (int32_t c = 0; c < PLANES; c++) {
        im.channel[c] = pixels[c];
        plate.channel[c] = pixels[PLANES + c];
        fill(plate.channel[c], VIEW_PIXELS, VIEW_SIZE + c, n % 5);
        for (int32_t i = 0; i < VIEW_PIXELS; i++) {
            int32_t const r = (int32_t)(noise((uint32_t)(i + c)) % 5), block = i >> 14 == 1 ? c * 70 - 60 : 0;
            im.channel[c][i] =
                (uint8_t)i_clamp(plate.channel[c][i] * gain[n / 5 % 5] / 16 + r + block, 0, 255);
        }
    }
    for (uint32_t i = 0; i < GRID_SIZE * GRID_WORDS; i++)
        inside[i / GRID_WORDS][i % GRID_WORDS] =
            n % 4 ? ~UINT64_C(0) : (uint64_t)noise(i) << 32 | noise(i + 1000);
    compute(isa_scalar(), &im, &plate, inside, &want);
    for (int k = 0; k < isa_count(); k++) {
        compute(isa_at(k), &im, &plate, inside, &have);
        CHECK(memcmp(want.grey, have.grey, sizeof want.grey) == 0);
        CHECK(memcmp(want.edge, have.edge, sizeof want.edge) == 0);
        CHECK(memcmp(want.surface, have.surface, sizeof want.surface) == 0);
        CHECK(memcmp(want.pairs, have.pairs, sizeof want.pairs) == 0);
        CHECK(memcmp(want.foreground, have.foreground, sizeof want.foreground) == 0 &&
              want.foreground_total == have.foreground_total);
    }
}

int main(void)
{
    for (uint32_t n = 0; n < CASES; n++) {
        sample_case(n);
        maps_case(n);
    }
    return CHECK_DONE();
}
