/* Depth order: by hand on rectangles, by brute force on the toy person. */
#include "api/kernels.h"
#include "raster/layers.h"

#include "filter/particles.h"
#include "toy_draw.h"
#include "toy_scene.h"
#include "toy_visible.h"

#include "check.h"

static layers drawn;
static outline_block outline;
static limb_geometry flat[MODEL_MAX_LIMBS]; /* cones: four vertices each */

static void rectangle(int32_t limb, int32_t lane, float x0, float y0, float x1, float y1, float depth)
{
    const float x[4] = {x0, x1, x1, x0}, y[4] = {y0, y0, y1, y1};
    for (int k = 0; k < 4; k++) {
        outline.limb[limb].x[k][lane] = x[k];
        outline.limb[limb].y[k][lane] = y[k];
    }
    outline.limb[limb].depth[lane] = depth;
}

static bool covers(const rast_spans *s, int32_t x, int32_t y)
{
    return y >= s->first && y < s->last && x >= s->begin[y] && x < s->end[y];
}

static int32_t count(const grid_mask *m)
{
    int32_t n = 0;
    for (int32_t w = 0; 64 * w < m->width; w++)
        for (int32_t y = m->first; y < m->last; y++)
            n += grid_popcount(m->word[w][y]);
    return n;
}

static void test_order(void)
{
    enum { NEXT = sizeof(outline_lanes) / sizeof(float) };
    static const float depth[] = {4.0f, 2.0f, 0.0f, 3.0f, 2.0f, -1.0f, 1.0f, NAN};
    static const int32_t want[] = {6, 1, 4, 3, 0};
    int32_t order[MODEL_MAX_LIMBS];
    for (int32_t l = 0; l < 8; l++) {
        outline.limb[l].depth[5] = depth[l];
        outline.limb[l].depth[4] = 1.0f;
    }
    CHECK(layers_order(&outline.limb[0].depth[5], NEXT, 8, order) == 5);
    CHECK(memcmp(order, want, sizeof want) == 0); /* near to far; equal ones by index; none behind */
    CHECK(layers_order(&outline.limb[0].depth[5], NEXT, 0, order) == 0);
}

/* Working pixels [20, 60) x [40, 100) are cells [10, 30) x [20, 50). */
static void test_cells(void)
{
    int32_t wrong = 0;
    memset(&drawn, 0xff, sizeof drawn);
    rectangle(0, 3, 20, 40, 60, 100, 2.0f);
    toy_draw(&outline, flat, 1, 3, &drawn);
    for (int32_t y = 0; y < GRID_SIZE; y++)
        for (int32_t x = 0; x < GRID_SIZE; x++) {
            bool const in = x >= 10 && x < 30 && y >= 20 && y < 50;
            wrong += toy_cell(&drawn.visible[0], x, y) != in;
            wrong += toy_cell(&drawn.whole, x, y) != in;
        }
    CHECK(wrong == 0);
    CHECK(drawn.whole.first <= 20 && drawn.whole.last >= 50);
    const grid_mask *const m = &drawn.visible[0];
    CHECK(toy_visible(m, 20.0f, 40.0f) && toy_visible(m, 59.9f, 99.9f));
    CHECK(!toy_visible(m, 19.9f, 40.0f) && !toy_visible(m, 60.0f, 50.0f));
    CHECK(!toy_visible(m, 30.0f, 39.9f) && !toy_visible(m, 30.0f, 100.0f));
    CHECK(!toy_visible(m, NAN, 50.0f) && !toy_visible(m, 30.0f, NAN));
    CHECK(!toy_visible(m, 1e30f, 50.0f) && !toy_visible(m, -1e30f, 50.0f));
    rectangle(0, 3, -100, -100, 400, 400, 2.0f); /* the whole grid, and not a cell more */
    toy_draw(&outline, flat, 1, 3, &drawn);
    CHECK(count(m) == GRID_SIZE * GRID_SIZE);
    CHECK(toy_visible(m, 0.0f, 0.0f) && toy_visible(m, 255.9f, 255.9f));
    CHECK(!toy_visible(m, -0.1f, 5.0f) && !toy_visible(m, 5.0f, -0.1f));
    CHECK(!toy_visible(m, 256.0f, 5.0f) && !toy_visible(m, 5.0f, 256.0f));
}

/* Bodies of any width anywhere across the grid and beyond it, two limbs each. */
static void test_columns(void)
{
    int32_t wrong = 0, narrow = 0, wide = 0;
    for (int32_t apart = 0; apart < 130; apart += 9)
        for (int32_t x = -40; x < 140; x++) { /* cells */
            float const a = 2.0f * (float)x, b = a + 2.0f * (float)apart;
            rectangle(0, 1, a, 20, a + 20, 60, 2.0f);
            rectangle(1, 1, b, 100, b + 20, 120, 3.0f);
            toy_draw(&outline, flat, 2, 1, &drawn);
            for (int32_t c = 0; c < GRID_SIZE; c++) {
                wrong += toy_cell(&drawn.visible[0], c, 20) != (c >= x && c < x + 10);
                wrong += toy_cell(&drawn.visible[1], c, 55) != (c >= x + apart && c < x + apart + 10);
                wrong += toy_cell(&drawn.whole, c, 55) != (c >= x + apart && c < x + apart + 10);
            }
            wrong += drawn.whole.column % GRID_STEP;
            narrow += drawn.whole.width == 64;
            wide += drawn.whole.width == GRID_SIZE;
        }
    CHECK(wrong == 0);
    CHECK(narrow > 500 && wide > 500);
}

/* The nearer limb hides the farther one, whatever their indices. */
static void test_hiding(void)
{
    memset(&drawn, 0xff, sizeof drawn);
    for (int32_t l = 0; l < 6; l++) { /* of a body before */
        drawn.visible[l].first = 0;
        drawn.visible[l].last = GRID_SIZE;
    }
    for (int swap = 0; swap < 2; swap++) {
        int32_t const near = swap, far = 1 - swap;
        rectangle(near, 0, 40, 40, 80, 80, 2.0f);
        rectangle(far, 0, 60, 20, 100, 100, 2.5f);
        rectangle(2, 0, 60, 40, 80, 80, 9.0f);     /* wholly hidden */
        rectangle(3, 0, 0, 0, 200, 200, 0.0f);     /* behind the camera */
        rectangle(4, 0, 300, 10, 400, 30, 1.0f);   /* outside */
        rectangle(5, 0, 120, 200, 140, 210, 3.0f); /* apart */
        toy_draw(&outline, flat, 6, 0, &drawn);
        CHECK(count(&drawn.visible[near]) == 20 * 20);
        CHECK(count(&drawn.visible[far]) == 20 * 40 - 10 * 20);
        CHECK(toy_cell(&drawn.visible[near], 35, 30) && !toy_cell(&drawn.visible[far], 35, 30));
        CHECK(toy_cell(&drawn.visible[far], 45, 30) && toy_cell(&drawn.visible[far], 35, 15));
        CHECK(count(&drawn.visible[2]) == 0 && count(&drawn.visible[3]) == 0 &&
              count(&drawn.visible[4]) == 0);
        CHECK(count(&drawn.visible[5]) == 10 * 5);
        CHECK(count(&drawn.whole) == 400 + 600 + 50);
        CHECK(drawn.whole.first <= 10 && drawn.whole.last >= 105);
    }
    toy_draw(&outline, flat, 0, 0, &drawn);
    CHECK(drawn.whole.first == drawn.whole.last && count(&drawn.whole) == 0);
}

/* The toy person: every cell belongs to the nearest limb whose polygon covers it. */
static void test_person(void)
{
    const gait_model *const m = toy_model();
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    cfg.components = 0;
    state_layout const rule = state_layout_init(m, &cfg, kernels_choose(~0u));
    static kin_body body;
    limb_geometry limbs[MODEL_MAX_LIMBS];
    limb_geometry_init(m, 1.0f, limbs);
    int32_t wrong = 0, hidden = 0, cells = 0;
    for (int n = 0; n < 24; n++) {
        gait_camera const cam = toy_camera(n % 2);
        view_map const map = {.scale = 1.4f, .u0 = 85.0f + 2.0f * (float)n, .v0 = 60.0f};
        gait_state const s = toy_walk(0.05f * (float)n);
        particle_state const w = particle_from_state(&rule, &s);
        particle_body(&rule, &w, &body);
        toy_project(limbs, m->limbs, &body, &cam, &map, &outline);
        int32_t const lane = n % BLOCK;
        toy_draw(&outline, limbs, m->limbs, lane, &drawn);
        static rast_spans alone[MODEL_MAX_LIMBS];
        for (int32_t l = 0; l < m->limbs; l++) {
            float x[RAST_MAX_VERTICES], y[RAST_MAX_VERTICES];
            for (int32_t k = 0; k < outline_vertices(&limbs[l]); k++) {
                x[k] = (outline.limb[l].x[k][lane] - 0.5f) / 2.0f;
                y[k] = (outline.limb[l].y[k][lane] - 0.5f) / 2.0f;
            }
            rast_convex(x, y, outline_vertices(&limbs[l]), 0, GRID_SIZE, &alone[l]);
        }
        for (int32_t y = 0; y < GRID_SIZE; y++)
            for (int32_t x = 0; x < GRID_SIZE; x++) {
                int32_t top = -1, covering = 0;
                for (int32_t l = 0; l < m->limbs; l++)
                    if (covers(&alone[l], x, y)) {
                        covering++;
                        top =
                            top < 0 || outline.limb[l].depth[lane] < outline.limb[top].depth[lane] ? l : top;
                    }
                for (int32_t l = 0; l < m->limbs; l++)
                    wrong += toy_cell(&drawn.visible[l], x, y) != (l == top);
                wrong += toy_cell(&drawn.whole, x, y) != (top >= 0);
                cells += top >= 0;
                hidden += covering > 1;
            }
    }
    CHECK(cells > 24 * 900 && hidden > 24 * 100);
    CHECK(wrong * 500 < cells); /* only cells whose centre an edge meets, by how it is rounded */
}

int main(void)
{
    test_order();
    test_cells();
    test_columns();
    test_hiding();
    test_person();
    return CHECK_DONE();
}
