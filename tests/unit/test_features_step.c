/* Features of all cameras' frames: regions, plates, formats, and people out of view. */
#include "tracker/features_step.h"

#include "image/camera.h"
#include "toy_tracker.h"

#include "check.h"

static uint8_t wall[SCENE_CAMERAS][SCENE_PIXELS], shot[SCENE_CAMERAS][SCENE_PIXELS];

static gait_tracker *tracker(int32_t cameras, uint32_t terms)
{
    gait_tracker_config cfg = toy_config(cameras);
    cfg.particles = 16;
    cfg.terms = terms;
    gait_tracker *const t = toy_tracker_new(&cfg);
    for (int k = 0; k < cameras; k++) {
        gait_image const plate = toy_image(wall[k]);
        CHECK(gait_tracker_set_background(t, k, &plate, NULL) == GAIT_OK);
    }
    toy_tracker_start(t, 20, 1.0f);
    return t;
}

/* The region contains the whole person, who is VIEW_PERSON tall in it. */
static void test_region(void)
{
    gait_tracker *const t = tracker(2, GAIT_TERM_EDGES);
    gait_state const s = toy_walk(20.0f / 30.0f);
    const uint8_t *const see[] = {shot[0], shot[1]};
    gait_estimate e;
    gait_pose pose;
    toy_tracker_step(t, 20, see, &e);
    CHECK(gait_model_pose(toy_model(), &s, &pose, NULL) == GAIT_OK);
    for (int k = 0; k < 2; k++) {
        gait_camera const cam = toy_camera(k);
        float high = 1e9f, low = -1e9f;
        for (int32_t p = 0; p < TOY_POINTS; p++) {
            float uv[2] = {0};
            camera_project(&cam, pose.joint[p], uv);
            float const x = (uv[0] - t->core->map[k].u0) * t->core->map[k].scale;
            float const y = (uv[1] - t->core->map[k].v0) * t->core->map[k].scale;
            CHECK(x > 30.0f && x < 226.0f && y > 15.0f && y < 241.0f);
            high = fminf(high, y);
            low = fmaxf(low, y);
        }
        CHECK_NEAR(low - high, 186.0, 12.0); /* head top to toe joint */
    }
    toy_tracker_free(t);
}

/* The plate follows the region: an empty scene has no foreground, wherever the region goes. */
static void test_plate(void)
{
    gait_tracker *const t = tracker(1, GAIT_TERM_SILHOUETTE);
    gait_frame f = toy_frame(20);
    int32_t moved = 0;
    f.image[0] = toy_image(wall[0]);
    for (int n = 0; n < 12; n++) {
        particle_state const w = {.f = {[F_X] = -1.5f + 0.3f * (float)n, [F_STATURE] = 1.75f}};
        float const before = t->core->map[0].u0;
        CHECK(features_step(t, &f, &w) == 1);
        moved += t->core->map[0].u0 != before;
        CHECK(t->camera[0].features.has_foreground && t->camera[0].features.foreground_total == 0);
    }
    CHECK(moved > 6);
    f.image[0] = toy_image(shot[0]);
    particle_state const there = {.f = {[F_X] = toy_walk(20.0f / 30.0f).pelvis[0], [F_STATURE] = 1.75f}};
    CHECK(features_step(t, &f, &there) == 1 && t->camera[0].features.foreground_total > 800 * FOREGROUND_ONE);
    CHECK(gait_tracker_set_background(t, 0, NULL, NULL) == GAIT_OK);
    CHECK(features_step(t, &f, &there) == 1 && !t->camera[0].features.has_foreground);
    gait_image const plate = toy_image(shot[0]); /* another plate takes effect at once */
    CHECK(gait_tracker_set_background(t, 0, &plate, NULL) == GAIT_OK);
    CHECK(features_step(t, &f, &there) == 1 && t->camera[0].features.has_foreground &&
          t->camera[0].features.foreground_total == 0);
    toy_tracker_free(t);
}

/* Plates and frames of any format together; what is one picture in two formats has no foreground. */
static void test_formats(void)
{
    static uint8_t colour[2][SCENE_PIXELS * 3], luma[SCENE_PIXELS]; /* RGB, BGR */
    for (int32_t i = 0; i < SCENE_PIXELS; i++) {
        const int32_t v = wall[0][i], rgb[3] = {v + 40, v, v - 30};
        for (int32_t c = 0; c < 3; c++)
            colour[0][3 * i + c] = colour[1][3 * i + 2 - c] = (uint8_t)rgb[c];
        luma[i] = (uint8_t)((77 * rgb[0] + 150 * rgb[1] + 29 * rgb[2] + 128) >> 8);
    }
    gait_image image[3] = {toy_image(colour[0]), toy_image(colour[1]), toy_image(luma)};
    for (int k = 0; k < 2; k++) {
        image[k].format = k ? GAIT_BGR8 : GAIT_RGB8;
        image[k].stride = 3 * SCENE_W;
    }
    particle_state const w = {.f = {[F_X] = -0.4f, [F_STATURE] = 1.75f}};
    for (int plate = 0; plate < 3; plate++) {
        gait_tracker *const t = tracker(1, GAIT_TERM_SILHOUETTE);
        CHECK(gait_tracker_set_background(t, 0, &image[plate], NULL) == GAIT_OK);
        for (int n = 0; n < 9; n++) { /* also changing from frame to frame */
            gait_frame f = toy_frame(n);
            f.image[0] = image[n < 6 ? n / 2 : n % 3];
            CHECK(features_step(t, &f, &w) == 1 && t->camera[0].features.has_foreground);
            CHECK(t->camera[0].features.foreground_total < GRID_SIZE * GRID_SIZE / 8); /* luma is rounded */
        }
        toy_tracker_free(t);
    }
}

/* A person behind the camera is out of its view. */
static void test_behind(void)
{
    gait_tracker *const t = tracker(2, 0xf);
    gait_frame f = toy_frame(20);
    particle_state w = {.f = {[F_X] = 0.0f, [F_Y] = -5.6f, [F_STATURE] = 1.75f}};
    for (int k = 0; k < 2; k++)
        f.image[k] = toy_image(shot[k]);
    CHECK(features_step(t, &f, &w) == 1 && !t->camera[0].features.has_image &&
          t->camera[1].features.has_image);
    w.f[F_Y] = 0.0f;
    CHECK(features_step(t, &f, &w) == 2);
    f.image[0].data = NULL;
    CHECK(features_step(t, &f, &w) == 1);
    toy_tracker_free(t);
}

static int32_t cells_inside(const features *f)
{
    int32_t cells = 0;
    for (int32_t y = 0; y < GRID_SIZE; y++)
        for (int32_t w = 0; w < GRID_WORDS; w++)
            cells += grid_popcount(f->inside[y][w]);
    return cells;
}

/* Cells that another person covers are neither foreground nor visible; the same picture changes nothing for that
 * person. */
static void test_others(void)
{
    static uint8_t nearest[SCENE_PIXELS];
    gait_tracker *const t = tracker(1, GAIT_TERM_SILHOUETTE);
    const features *const found = &t->camera[0].features;
    gait_state const s = toy_walk(20.0f / 30.0f);
    gait_camera const cam = toy_camera(0);
    particle_state const there = {.f = {[F_X] = s.pelvis[0], [F_STATURE] = 1.75f}};
    gait_frame f = toy_frame(20);
    f.image[0] = toy_image(shot[0]);
    CHECK(features_step(t, &f, &there) == 1);
    int32_t const foreground = found->foreground_total, inside = cells_inside(found);
    CHECK(gait_render(toy_model(), &cam, &s, nearest, SCENE_W, NULL) == GAIT_OK);
    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        nearest[i] = nearest[i] ? 2 : 0;
    f.people[0] = toy_image(nearest);
    for (f.person = 1; f.person <= 2; f.person++) {
        CHECK(features_step(t, &f, &there) == 1 && found->has_foreground);
        bool const own = f.person == 2;
        CHECK(own ? found->foreground_total == foreground : found->foreground_total < foreground / 4);
        CHECK(own ? cells_inside(found) == inside
                  : inside - cells_inside(found) > foreground / 2 / FOREGROUND_ONE);
    }
    f.people[0].width--;
    CHECK(gait_tracker_step(t, &f, &(gait_estimate){0}, NULL) == GAIT_ERR_ARG);
    toy_tracker_free(t);
}

int main(void)
{
    for (int k = 0; k < SCENE_CAMERAS; k++) {
        toy_wall(k, wall[k]);
        toy_shot(k, 20, shot[k]);
    }
    test_region();
    test_plate();
    test_formats();
    test_behind();
    test_others();
    return CHECK_DONE();
}
