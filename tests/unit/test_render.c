/* gait_render() against the layers, which draw the same picture, and across the seams of its bands. */
#include "api/kernels.h"
#include "raster/layers.h"
#include "toy_draw.h"
#include "toy_scene.h"
#include "toy_visible.h"

#include "check.h"

enum { SIDE = 512 };

static uint8_t ids[SIDE * SIDE], other[SIDE * SIDE];

static gait_camera camera(int32_t width, int32_t height)
{
    gait_camera c = toy_camera(1);
    c.width = width;
    c.height = height;
    return c;
}

/* With a grid cell for every pixel the layers are the picture. */
static void test_against_layers(void)
{
    const gait_model *const m = toy_model();
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    cfg.components = 0;
    state_layout const rule = state_layout_init(m, &cfg, kernels_choose(~0u));
    static kin_body body;
    static outline_block outline;
    static layers drawn;
    limb_geometry limbs[MODEL_MAX_LIMBS];
    limb_geometry_init(m, 1.0f, limbs);
    view_map const map = {.scale = 2.0f, .u0 = -0.25f, .v0 = -0.25f}; /* cell = pixel */
    int32_t wrong = 0, seen = 0;
    for (int n = 0; n < 10; n++) {
        gait_camera cam = camera(GRID_SIZE, GRID_SIZE);
        cam.fx = cam.fy = 320.0f;
        cam.cx = 64.0f;
        cam.cy = 72.0f;
        gait_state s = toy_walk(0.1f * (float)n);
        s.pelvis[0] = 0.0f;
        particle_state const w = particle_from_state(&rule, &s);
        particle_body(&rule, &w, &body);
        toy_project(limbs, m->limbs, &body, &cam, &map, &outline);
        toy_draw(&outline, limbs, m->limbs, 0, &drawn);
        CHECK(gait_render(m, &cam, &s, ids, SIDE, NULL) == GAIT_OK);
        for (int32_t y = 0; y < GRID_SIZE; y++)
            for (int32_t x = 0; x < GRID_SIZE; x++) {
                int32_t id = 0;
                for (int32_t l = 0; l < m->limbs; l++)
                    if (toy_visible(&drawn.visible[l], 2.0f * (float)x + 0.5f, 2.0f * (float)y + 0.5f))
                        id = l + 1;
                wrong += ids[y * SIDE + x] != id;
                seen += id > 0;
            }
    }
    CHECK(seen > 10 * 800);
    CHECK(wrong < 10); /* float rounding differs at the edges */
}

/* A picture moved by whole pixels is the same picture: the bands have no seams. */
static void test_bands(void)
{
    gait_camera cam = camera(SIDE, SIDE);
    gait_state s = toy_walk(0.8f);
    s.pelvis[0] = 0.0f;
    cam.fx = cam.fy = 1024.0f;
    cam.cx = 256.0f;
    cam.cy = 256.0f;
    CHECK(gait_render(toy_model(), &cam, &s, ids, SIDE, NULL) == GAIT_OK);
    cam.cy += 37.0f;
    CHECK(gait_render(toy_model(), &cam, &s, other, SIDE, NULL) == GAIT_OK);
    int32_t wrong = 0, drawn = 0;
    for (int32_t y = 0; y < SIDE - 37; y++)
        for (int32_t x = 0; x < SIDE; x++) {
            wrong += ids[y * SIDE + x] != other[(y + 37) * SIDE + x];
            drawn += ids[y * SIDE + x] > 0;
        }
    CHECK(drawn > 9000);
    CHECK(wrong < drawn / 2000);
}

/* Every pixel is written, nothing beside them is. */
static void test_writes(void)
{
    enum { W = 200, H = 150, STRIDE = 210 };
    gait_camera cam = camera(W, H);
    gait_state s = toy_walk(0.8f);
    memset(ids, 0xee, sizeof ids);
    CHECK(gait_render(toy_model(), &cam, &s, ids, STRIDE, NULL) == GAIT_OK);
    int32_t unwritten = 0, beside = 0;
    for (int32_t y = 0; y < H; y++)
        for (int32_t x = 0; x < STRIDE; x++)
            *(x < W ? &unwritten : &beside) += (ids[y * STRIDE + x] == 0xee) == (x < W);
    for (int32_t i = H * STRIDE; i < SIDE * SIDE; i++)
        beside += ids[i] != 0xee;
    CHECK(unwritten == 0 && beside == 0);
    s.pelvis[1] = -50.0f; /* behind the camera: an empty picture */
    CHECK(gait_render(toy_model(), &cam, &s, ids, STRIDE, NULL) == GAIT_OK);
    int32_t any = 0;
    for (int32_t i = 0; i < W; i++)
        any += ids[75 * STRIDE + i] != 0;
    CHECK(any == 0);
}

/* The limbs are where the joints are: middles of the near side's limbs. */
static void test_places(void)
{
    static const struct {
        const char *from, *to, *limb;
    } part[] = {{"r_hip", "r_knee", "r_thigh"},
                {"r_knee", "r_ankle", "r_shank"},
                {"r_elbow", "r_wrist", "r_forearm"},
                {"neck", "head_top", "head"}};
    const gait_model *const m = toy_model();
    gait_camera const cam = toy_camera(0); /* sees the right side */
    int32_t hits = 0, tries = 0;
    for (int n = 0; n < 20; n++) {
        gait_state const s = toy_walk(0.08f * (float)n);
        gait_pose pose;
        CHECK(gait_render(m, &cam, &s, ids, SCENE_W, NULL) == GAIT_OK &&
              gait_model_pose(m, &s, &pose, NULL) == GAIT_OK);
        for (size_t k = 0; k < sizeof part / sizeof *part; k++) {
            const float *const a = pose.joint[toy_find_point(m, part[k].from)];
            const float *const b = pose.joint[toy_find_point(m, part[k].to)];
            const float mid[3] = {0.5f * (a[0] + b[0]), 0.5f * (a[1] + b[1]), 0.5f * (a[2] + b[2])};
            float uv[2] = {0};
            camera_project(&cam, mid, uv);
            int32_t const id = ids[(int32_t)(uv[1] + 0.5f) * SCENE_W + (int32_t)(uv[0] + 0.5f)];
            tries++;
            hits += id > 0 && strcmp(gait_model_limb_name(m, id - 1), part[k].limb) == 0;
        }
    }
    CHECK(hits > tries * 9 / 10); /* hands may pass in front of the thigh */
}

static void test_errors(void)
{
    const gait_model *const m = toy_model();
    gait_camera cam = camera(64, 64);
    gait_state s = toy_walk(0.0f);
    CHECK(gait_render(NULL, &cam, &s, ids, 64, NULL) == GAIT_ERR_ARG);
    CHECK(gait_render(m, NULL, &s, ids, 64, NULL) == GAIT_ERR_ARG);
    CHECK(gait_render(m, &cam, NULL, ids, 64, NULL) == GAIT_ERR_ARG);
    CHECK(gait_render(m, &cam, &s, NULL, 64, NULL) == GAIT_ERR_ARG);
    CHECK(gait_render(m, &cam, &s, ids, 63, NULL) == GAIT_ERR_ARG);
    memset(ids, 9, 64);
    s.phase = NAN;
    CHECK(gait_render(m, &cam, &s, ids, 64, NULL) == GAIT_ERR_ARG && ids[0] == 9);
    s.phase = 0.0f;
    cam.width = RAST_LIMIT + 1;
    CHECK(gait_render(m, &cam, &s, ids, RAST_LIMIT + 1, NULL) == GAIT_ERR_LIMIT);
    cam.width = 64;
    cam.R[0] = 2.0f;
    CHECK(gait_render(m, &cam, &s, ids, 64, NULL) == GAIT_ERR_ARG && ids[0] == 9);
}

int main(void)
{
    test_against_layers();
    test_bands();
    test_writes();
    test_places();
    test_errors();
    return CHECK_DONE();
}
