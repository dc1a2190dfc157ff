/* Outlines, edges and masks of every instruction set against the scalar ones: toy people, and any bits as coordinates. */
#include "kernel_check.h"
#include "raster/layers.h"

#include "filter/particles.h"
#include "base/rng.h"
#include "toy_scene.h"

#include "check.h"

static outline_block outline;
static layers_block edges;
static layers drawn[BLOCK];
static _Alignas(GAIT_ALIGN) unsigned char memory[sizeof(layers_block) + sizeof(outline_block) +
                                                 sizeof(layers) + 2 * GUARD];

/* Rows outside a mask are undefined: each instruction set may have written others. */
static bool same_mask(const grid_mask *a, const grid_mask *b)
{
    bool same = a->first == b->first && a->last == b->last && a->column == b->column && a->width == b->width;
    for (int32_t w = 0; same && 64 * w < a->width; w++)
        for (int32_t y = a->first; y < a->last; y++)
            same &= a->word[w][y] == b->word[w][y];
    return same;
}

static bool same_layers(const layers *a, const layers *b, int32_t count)
{
    bool same = same_mask(&a->whole, &b->whole);
    for (int32_t l = 0; l < count; l++)
        same &= same_mask(&a->visible[l], &b->visible[l]);
    return same && memcmp(&a->visible[count], &b->visible[count],
                          (size_t)(MODEL_MAX_LIMBS - count) * sizeof *a->visible) == 0;
}

/* Each other set draws the block as in `outline`, `edges` and `drawn`. */
static void compare_layers(const limb_geometry *limbs, int32_t count)
{
    memset(&edges, 0xa5, sizeof edges);
    isa_scalar()->layers_prepare(&outline, limbs, count, &edges);
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        memset(&drawn[lane], 0xa5, sizeof drawn[lane]);
        isa_scalar()->layers_draw(&edges, lane, &drawn[lane]);
    }
    for (int k = 0; k < isa_count(); k++) {
        guarded g = guard_fill(memory, sizeof edges);
        isa_at(k)->layers_prepare(&outline, limbs, count, (layers_block *)(void *)g.begin);
        CHECK(guard_whole(&g) && memcmp(g.begin, &edges, sizeof edges) == 0);
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            g = guard_fill(memory, sizeof(layers));
            isa_at(k)->layers_draw(&edges, lane, (layers *)(void *)g.begin);
            CHECK(guard_whole(&g) && same_layers((const layers *)(void *)g.begin, &drawn[lane], count));
        }
    }
}

/* Bodies of a block, each lane another, some of them at or behind the camera. */
static void people(int round, const state_layout *rule, particle_set *p)
{
    for (int32_t i = 0; i < BLOCK; i++) {
        gait_state s = toy_walk(0.13f * (float)round + 0.21f * (float)i);
        s.heading += 0.4f * (float)i;
        s.stature *= 1.0f + 0.02f * (float)i;
        s.pelvis[0] += round % 3 ? 0.05f * (float)i : 0.9f * (float)(i - 8);
        s.pelvis[1] += round % 3 ? 0.0f : 0.7f * (float)(i - 8);
        particle_state const w = particle_from_state(rule, &s);
        particle_put(p, i, &w);
    }
}

static void test_people(void)
{
    const gait_model *const m = toy_model();
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    state_layout const rule = state_layout_init(m, &cfg, kernels_choose(~0u));
    static float value[F_MAX * BLOCK];
    particle_set p = {.n = BLOCK, .fields = state_layout_fields(&rule), .value = value};
    static kin_body body;
    limb_geometry limbs[MODEL_MAX_LIMBS];
    limb_geometry_init(m, 1.05f, limbs);
    for (int round = 0; round < 30; round++) {
        gait_camera const cam = toy_camera(round % 2);
        view_map const map = {.scale = 1.4f, .u0 = 85.0f + (float)round, .v0 = 60.0f};
        people(round, &rule, &p);
        particle_set_bodies(&rule, &p, 0, &body);
        memset(&outline, 0xa5, sizeof outline);
        isa_scalar()->outline_project(limbs, m->limbs, &body, &cam, &map, &outline);
        for (int k = 0; k < isa_count(); k++) {
            guarded const g = guard_fill(memory, sizeof outline);
            isa_at(k)->outline_project(limbs, m->limbs, &body, &cam, &map, (outline_block *)(void *)g.begin);
            CHECK(guard_whole(&g) && memcmp(g.begin, &outline, sizeof outline) == 0);
        }
        compare_layers(limbs, m->limbs);
    }
}

/* Any bits, and the numbers at which something changes. */
static float extreme(uint32_t index, uint32_t draw)
{
    static const float numbers[] = {NAN,   INFINITY, -INFINITY, 1e30f,  FLT_MAX, 0.0f,  -0.0f,
                                    31999, -32001,   127.5f,    128.0f, 256.5f,  1e-40f};
    uint32_t r[4];
    float any;
    rng_bits(31, 0, 0, index, draw, r);
    memcpy(&any, &r[0], sizeof any);
    return r[1] % 8 == 0   ? any
           : r[1] % 8 == 1 ? numbers[r[2] % (sizeof numbers / sizeof *numbers)]
           : r[1] % 8 == 2 ? 0.5f * (float)(r[2] % 600)
                           : (float)(r[2] % 300000) / 1000.0f - 20.0f;
}

static void extreme_limb(uint32_t l, uint32_t round, outline_lanes *out)
{
    for (uint32_t k = 0; k < RAST_MAX_VERTICES; k++)
        for (uint32_t lane = 0; lane < BLOCK; lane++) {
            uint32_t const i = (l * RAST_MAX_VERTICES + k) * BLOCK + lane;
            out->x[k][lane] = extreme(i, 4 * round);
            out->y[k][lane] = extreme(i, 4 * round + 1);
        }
    for (uint32_t lane = 0; lane < BLOCK; lane++) {
        uint32_t const i = l * BLOCK + lane;
        out->depth[lane] =
            round % 2 ? f_min(extreme(i, 4 * round + 2), 1e30f) : (float)(i * 7 % 5); /* many are equal */
    }
}

static void test_garbage(void)
{
    enum { NEXT = sizeof(outline_lanes) / sizeof(float) };
    static limb_geometry limbs[MODEL_MAX_LIMBS];
    for (uint32_t round = 0; round < 40; round++) {
        int32_t const count = (int32_t)(round * 7 % (MODEL_MAX_LIMBS + 1));
        for (uint32_t l = 0; l < MODEL_MAX_LIMBS; l++) {
            extreme_limb(l, round, &outline.limb[l]);
            limbs[l].shape = (l + round) % 3 ? LIMB_CONE : LIMB_ELLIPSOID;
        }
        compare_layers(limbs, count);
        int32_t wrong = 0;
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            int32_t order[MODEL_MAX_LIMBS];
            int32_t const front = layers_order(&outline.limb[0].depth[lane], NEXT, count, order);
            for (int32_t k = 0; k < front; k++)
                wrong += edges.order[lane][k] != order[k];
        }
        CHECK(wrong == 0);
    }
}

int main(void)
{
    test_people();
    test_garbage();
    return CHECK_DONE();
}
