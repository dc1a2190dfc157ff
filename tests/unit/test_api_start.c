/* Public functions of the automatic start: what they refuse, and that a refusal changes nothing. */
#include "toy_segment.h"
#include "toy_start.h"

#include <string.h>

enum { WIDTH = 64, HEIGHT = 48 };

static uint8_t pixels[WIDTH * HEIGHT * 3];

static gait_start_config usual(void)
{
    gait_start_config cfg;
    gait_start_default(&cfg);
    cfg.camera = level_camera(WIDTH, HEIGHT, 50.0f);
    return cfg;
}

static void test_null(void)
{
    gait_start_config const cfg = usual();
    gait_start *const s = toy_start_new(cfg.camera, ~0u), *none = NULL;
    gait_camera_pose const pose = {.R = {1, 0, 0, 0, 0, -1, 0, 1, 0}, .t = {0, 1.5f, 0}};
    gait_keypoint k[GAIT_MAX_JOINTS] = {{0}};
    gait_image const image = {pixels, WIDTH, HEIGHT, WIDTH * 3, GAIT_RGB8};
    gait_box box = {{30, 40}, {30, 10}, 1};
    gait_hypothesis h = {.probability = 5};
    gait_error err = {0};
    size_t bytes = 7;
    int32_t n = 7;
    float stature = 7;
    static _Alignas(GAIT_ALIGN) unsigned char mem[64];
    gait_result const refused[] = {
        gait_start_bytes(NULL, &cfg, &bytes, &err),
        gait_start_bytes(toy_model(), NULL, &bytes, &err),
        gait_start_bytes(toy_model(), &cfg, NULL, &err),
        gait_start_init(NULL, sizeof mem, toy_model(), &cfg, &none, &err),
        gait_start_init(mem, sizeof mem, NULL, &cfg, &none, &err),
        gait_start_init(mem, sizeof mem, toy_model(), NULL, &none, &err),
        gait_start_init(mem, sizeof mem, toy_model(), &cfg, NULL, &err),
        gait_start_set_pose(NULL, &pose, &err),
        gait_start_set_pose(s, NULL, &err),
        gait_start_add(NULL, 0, k, &err),
        gait_start_add(s, 0, NULL, &err),
        gait_start_add_boxes(NULL, 0, &box, 1, &err),
        gait_start_add_boxes(s, 0, NULL, 1, &err),
        gait_start_find_boxes(NULL, &image, &image, &box, 1, &n, &err),
        gait_start_find_boxes(s, NULL, &image, &box, 1, &n, &err),
        gait_start_find_boxes(s, &image, NULL, &box, 1, &n, &err),
        gait_start_find_boxes(s, &image, &image, NULL, 1, &n, &err),
        gait_start_find_boxes(s, &image, &image, &box, 1, NULL, &err),
        gait_start_other_scene(NULL, &image, &image, &n, &err),
        gait_start_other_scene(s, NULL, &image, &n, &err),
        gait_start_other_scene(s, &image, NULL, &n, &err),
        gait_start_other_scene(s, &image, &image, NULL, &err),
        gait_start_box_stature(NULL, &box, &stature, &err),
        gait_start_box_stature(s, NULL, &stature, &err),
        gait_start_box_stature(s, &box, NULL, &err),
        gait_start_solve(NULL, 0, &h, 1, &n, &err),
        gait_start_solve(s, 0, NULL, 1, &n, &err),
        gait_start_solve(s, 0, &h, 1, NULL, &err),
    };
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++)
        CHECK(refused[i] == GAIT_ERR_ARG);
    CHECK(strstr(err.text, "gait_start_solve") && !none);
    CHECK(bytes == 7 && n == 7 && stature == 7.0f && h.probability == 5.0f && box.sd == 1.0f);
    gait_start_reset(NULL);
    CHECK(!gait_hypothesis_walks(NULL));
    /* nothing was added: the first frame and the first boxes may have any time */
    CHECK(gait_start_add(s, INT64_MIN, k, NULL) == GAIT_OK);
    CHECK(gait_start_add_boxes(s, INT64_MIN, NULL, 0, NULL) == GAIT_OK);
    free(s);
}

static void test_config(void)
{
    size_t bytes = 0;
    gait_error err = {0};
    gait_start_config c = usual();
    c.stature = 0.4f;
    CHECK(gait_start_bytes(toy_model(), &c, &bytes, &err) == GAIT_ERR_ARG);
    CHECK(strstr(err.text, "stature is neither 0 nor in [0.5, 2.5] metres"));
    c.stature = 0.5f;
    CHECK(gait_start_bytes(toy_model(), &c, &bytes, NULL) == GAIT_OK && bytes > 0);
    c.cpu_mask = 1u << 31;
    CHECK(gait_start_bytes(toy_model(), &c, &bytes, &err) == GAIT_ERR_ARG && strstr(err.text, "cpu_mask"));
    c = usual();
    c.camera.R[0] = 0.5f;
    CHECK(gait_start_bytes(toy_model(), &c, &bytes, &err) == GAIT_ERR_ARG && strstr(err.text, "camera: "));
    /* of a header whose config ends before the camera */
    c = usual();
    c.struct_size = offsetof(gait_start_config, camera);
    CHECK(gait_start_bytes(toy_model(), &c, &bytes, &err) == GAIT_ERR_STRUCT);
    c.struct_size = sizeof c + 8;
    CHECK(gait_start_bytes(toy_model(), &c, &bytes, &err) == GAIT_ERR_STRUCT);
}

/* Another header's size: no byte after it is written. */
static void test_fill(void)
{
    gait_start_config c;
    memset(&c, 0x55, sizeof c);
    gait_start_fill(&c, offsetof(gait_start_config, camera));
    CHECK(c.struct_size == offsetof(gait_start_config, camera) && c.joint_sd == 0.025f);
    CHECK(((unsigned char *)&c)[offsetof(gait_start_config, camera)] == 0x55);
    gait_start_fill(&c, sizeof c + 100);
    CHECK(c.struct_size == sizeof c);
    gait_start_fill(NULL, sizeof c);
}

static void test_model(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char blob[TOY_BYTES], memory[1 << 16];
    static toy_segments segments;
    gait_start_config const c = usual();
    gait_model *m = NULL;
    gait_error err = {0};
    size_t bytes = 0;
    toy_segments_fill(&segments, 1, 0);
    CHECK(gait_model_init(memory, sizeof memory, blob, toy_segments_write(blob, &segments), &m, NULL) ==
          GAIT_OK);
    CHECK(gait_start_bytes(m, &c, &bytes, &err) != GAIT_OK && err.text[0] && bytes == 0);
}

static void test_memory(void)
{
    gait_start_config const c = usual();
    gait_start *s = NULL;
    size_t bytes = 0;
    CHECK(gait_start_bytes(toy_model(), &c, &bytes, NULL) == GAIT_OK);
    void *const mem = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN) / GAIT_ALIGN * GAIT_ALIGN);
    CHECK(gait_start_init(mem, bytes - 1, toy_model(), &c, &s, NULL) == GAIT_ERR_MEMORY && !s);
    CHECK(gait_start_init(mem, bytes, toy_model(), &c, &s, NULL) == GAIT_OK && s);
    free(mem);
}

/* A camera below the floor, or a foot above the horizon, has no stature. */
static void test_stature(void)
{
    gait_start *const s = toy_start_new(level_camera(WIDTH, HEIGHT, 50.0f), ~0u);
    gait_box const above = {{30, 20}, {30, 10}, 1}, good = {{30, 45}, {30, 18}, 1};
    gait_camera_pose const below = {.R = {1, 0, 0, 0, 0, -1, 0, 1, 0}, .t = {0, -1.5f, 0}};
    float stature = 0;
    CHECK(gait_start_box_stature(s, &good, &stature, NULL) == GAIT_OK && stature > 1.2f && stature < 2.4f);
    CHECK(gait_start_box_stature(s, &above, &stature, NULL) == GAIT_OK && isnan(stature));
    CHECK(gait_start_set_pose(s, &below, NULL) == GAIT_OK);
    CHECK(gait_start_box_stature(s, &good, &stature, NULL) == GAIT_OK && isnan(stature));
    for (int i = 0; i < 5; i++) { /* each number of a box */
        gait_box bad = good;
        float *const number[] = {&bad.foot[0], &bad.foot[1], &bad.head[0], &bad.head[1], &bad.sd};
        *number[i] = INFINITY;
        CHECK(gait_start_box_stature(s, &bad, &stature, NULL) == GAIT_ERR_ARG);
    }
    free(s);
}

/* A start from joints or from boxes; each value at which it does not count as a walk. */
static void test_walks(void)
{
    gait_hypothesis const joints = {.mean = {.stride_hz = 0.9f}, .speed = 1, .chi2_per_observation = 1};
    gait_hypothesis const boxes = {.sd = {.phase = 0.5f, .heading = 1},
                                   .speed = 1,
                                   .speed_sd = 0.2f,
                                   .probability = 0.5f,
                                   .chi2_per_observation = 1};
    gait_hypothesis h = joints;
    CHECK(gait_hypothesis_walks(&joints) && gait_hypothesis_walks(&boxes));
    h.speed = 0.2f;
    CHECK(!gait_hypothesis_walks(&h));
    h.in_place = 1;
    CHECK(gait_hypothesis_walks(&h));
    h.mean.stride_hz = 0.2f;
    CHECK(!gait_hypothesis_walks(&h));
    h = joints;
    h.chi2_per_observation = 2;
    CHECK(!gait_hypothesis_walks(&h));
    for (int i = 0; i < 6; i++) {
        h = boxes;
        h.in_place = i == 0;
        h.speed = i == 1 ? 0.35f : h.speed;
        h.speed_sd = i == 2 ? 0.6f : h.speed_sd;
        h.probability = i == 3 ? 0.2f : h.probability;
        h.sd.heading = i == 4 ? 3.2f : h.sd.heading;
        h.chi2_per_observation = i == 5 ? 2 : h.chi2_per_observation;
        CHECK(!gait_hypothesis_walks(&h));
    }
}

int main(void)
{
    test_null();
    test_config();
    test_fill();
    test_model();
    test_memory();
    test_stature();
    test_walks();
    return CHECK_DONE();
}
