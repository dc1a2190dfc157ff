/* The automatic start from boxes and blobs: people of known place, direction, stature and speed are found.
 *
 * With the argument `digest` it only prints those of a start (golden.h). */
#include "base/hash.h"
#include "base/rng.h"
#include "image/camera.h"
#include "toy_start.h"

#include <string.h>

enum { FRAMES = 30, WIDTH = 320, HEIGHT = 180 };

typedef struct walk {
    float heading, speed, stature, x, y, noise; /* noise: pixels */
} walk;

static gait_camera camera(void)
{
    return level_camera(WIDTH, HEIGHT, 250.0f);
}

static gait_box box_of(const walk *w, float t, uint32_t n)
{
    gait_camera const cam = camera();
    float sn, cs, e[4];
    gait_box b = {.sd = w->noise};
    m_sincos_one(w->heading, &sn, &cs);
    float const x = w->x + w->speed * t * cs, y = w->y + w->speed * t * sn, away = sqrtf(x * x + y * y),
                lead = 0.1f * w->stature / away;
    (void)camera_project(&cam, (const float[3]){x - lead * x, y - lead * y, 0.0f}, b.foot);
    (void)camera_project(&cam, (const float[3]){x, y, 0.98f * w->stature}, b.head);
    rng_normal4(3, 1, n, 0, 0, e);
    for (int k = 0; k < 2; k++) {
        b.foot[k] += w->noise * e[k];
        b.head[k] += w->noise * e[2 + k];
    }
    return b;
}

static int32_t find_by(uint32_t cpu_mask, const walk *w, int people,
                       gait_hypothesis h[GAIT_START_MAX_HYPOTHESES])
{
    gait_start *const s = toy_start_new(camera(), cpu_mask);
    int32_t count = 0;
    for (int n = 0; n < FRAMES; n++) {
        gait_box b[2];
        for (int p = 0; p < people; p++)
            b[(p + n) % people] = box_of(&w[p], (float)n / 25.0f, (uint32_t)(FRAMES * p + n));
        CHECK(gait_start_add_boxes(s, n * 40000, b, people, NULL) == GAIT_OK);
    }
    CHECK(gait_start_solve(s, 0, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) == GAIT_OK);
    free(s);
    return count;
}

static int32_t find(const walk *w, int people, gait_hypothesis h[GAIT_START_MAX_HYPOTHESES])
{
    return find_by(~0u, w, people, h);
}

static void test_headings(void)
{
    for (int k = 0; k < 8; k++) {
        walk const w = {.heading = m_wrap_pi(0.785f * (float)k + 0.1f),
                        .speed = 1.3f,
                        .stature = 1.8f,
                        .y = 5.0f,
                        .noise = 1.0f};
        gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
        CHECK(find(&w, 1, h) >= 1);
        CHECK(!h->in_place && fabsf(m_wrap_pi(h->mean.heading - w.heading)) < 2.0f * h->sd.heading + 0.1f);
        CHECK(h->sd.heading < 0.7f);
        CHECK(fabsf(h->mean.stature - w.stature) < 0.12f && fabsf(h->speed - w.speed) < 0.35f);
        CHECK(fabsf(h->mean.pelvis[0]) < 0.3f && fabsf(h->mean.pelvis[1] - 5.0f) < 0.45f);
        CHECK(h->sd.phase >= 0.5f); /* unknown */
    }
}

static void test_one_stands_and_one_walks(void)
{
    walk const w[2] = {
        {.stature = 1.75f, .x = -1.5f, .y = 4.5f, .noise = 0.7f},
        {.heading = 0.2f, .speed = 1.2f, .stature = 1.7f, .x = 1.0f, .y = 7.0f, .noise = 0.7f}};
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    int32_t const n = find(w, 2, h);
    int32_t stands = -1;
    CHECK(n >= 2);
    CHECK(!h->in_place && fabsf(h->mean.pelvis[0] - 1.0f) < 0.4f);
    for (int32_t i = 0; i < n; i++)
        stands = stands < 0 && h[i].in_place ? i : stands;
    CHECK(stands > 0 && fabsf(h[stands].mean.pelvis[0] + 1.5f) < 0.3f && h[stands].sd.heading > 3.0f);
    float sum = 0.0f;
    for (int32_t i = 0; i < n; i++)
        sum += h[i].probability;
    CHECK_NEAR(sum, 1.0f, 1e-4);
}

/* ---- blobs ---- */
static uint8_t plate[HEIGHT][WIDTH][3], picture[HEIGHT][WIDTH][3];

static gait_image image_of(uint8_t (*pixels)[WIDTH][3])
{
    return (gait_image){pixels[0][0], WIDTH, HEIGHT, WIDTH * 3, GAIT_BGR8};
}

static void draw(int x0, int x1, int y0, int y1, uint8_t value)
{
    for (int y = y0; y < y1; y++)
        memset(picture[y][x0], value, (size_t)(x1 - x0) * 3);
}

static void test_blobs(void)
{
    gait_start *const s = toy_start_new(camera(), ~0u);
    gait_image const scene = image_of(plate), frame = image_of(picture);
    gait_box b[3];
    int32_t count = -1, other = -1;
    float stature = 0.0f;
    memset(plate, 90, sizeof plate);
    memset(picture, 97, sizeof picture); /* another exposure */
    CHECK(gait_start_find_boxes(s, &frame, &scene, b, 3, &count, NULL) == GAIT_OK && count == 0);
    CHECK(gait_start_other_scene(s, &frame, &scene, &other, NULL) == GAIT_OK && other == 0);
    draw(100, 130, 60, 160, 200); /* the larger person */
    draw(220, 240, 70, 140, 30);
    draw(0, 20, 60, 160, 200);  /* cut off by the border */
    draw(140, 200, 20, 40, 30); /* too wide */
    CHECK(gait_start_find_boxes(s, &frame, &scene, b, 3, &count, NULL) == GAIT_OK && count == 2);
    CHECK_NEAR(b[0].foot[0], 115.0f, 1.5);
    CHECK_NEAR(b[0].foot[1], 160.0f, 1.5);
    CHECK_NEAR(b[0].head[1], 60.0f, 1.5);
    CHECK_NEAR(b[1].foot[1], 140.0f, 1.5);
    CHECK(gait_start_find_boxes(s, &frame, &scene, b, 1, &count, NULL) == GAIT_OK && count == 1);
    CHECK_NEAR(b[0].foot[0], 115.0f, 1.5);
    CHECK(gait_start_box_stature(s, b, &stature, NULL) == GAIT_OK && stature > 2.0f && stature < 2.2f);
    b->foot[1] = 50.0f; /* above the horizon */
    CHECK(gait_start_box_stature(s, b, &stature, NULL) == GAIT_OK && isnan(stature));
    draw(0, WIDTH, 0, HEIGHT / 4, 255);
    draw(0, WIDTH, HEIGHT / 4, HEIGHT / 2, 0);
    draw(0, WIDTH, HEIGHT / 2, 3 * HEIGHT / 4, 160);
    CHECK(gait_start_other_scene(s, &frame, &scene, &other, NULL) == GAIT_OK && other == 1);
    free(s);
}

/* White where the plate is black, in a picture that has become darker: the change exceeds 255. */
static void test_largest_change(void)
{
    gait_start *const s = toy_start_new(camera(), ~0u);
    gait_image const scene = image_of(plate), frame = image_of(picture);
    gait_box b;
    int32_t count = -1;
    memset(plate, 250, sizeof plate);
    memset(picture, 10, sizeof picture);
    for (int y = 60; y < 160; y++)
        memset(plate[y][100], 0, 30 * 3);
    draw(100, 130, 60, 160, 255);
    CHECK(gait_start_find_boxes(s, &frame, &scene, &b, 1, &count, NULL) == GAIT_OK && count == 1);
    CHECK_NEAR(b.foot[0], 115.0f, 1.5);
    free(s);
}

/* Of grey and of coloured pictures the same boxes are found; a person at any border is not in full view. */
static void test_formats_and_borders(void)
{
    gait_start *const s = toy_start_new(camera(), ~0u);
    static uint8_t grey[2][HEIGHT][WIDTH];
    gait_image const scene = image_of(plate), frame = image_of(picture),
                     grey_scene = {grey[0][0], WIDTH, HEIGHT, WIDTH, GAIT_GREY8},
                     grey_frame = {grey[1][0], WIDTH, HEIGHT, WIDTH, GAIT_GREY8};
    static const int place[5][4] = {
        {100, 130, 60, 160}, {0, 30, 60, 160}, {290, 320, 60, 160}, {100, 130, 0, 100}, {100, 130, 80, 180}};
    for (int i = 0; i < 5; i++) {
        gait_box b[4][2];
        int32_t count = -1;
        memset(plate, 90, sizeof plate);
        memset(picture, 90, sizeof picture);
        draw(place[i][0], place[i][1], place[i][2], place[i][3], 200);
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++) {
                grey[0][y][x] = plate[y][x][0];
                grey[1][y][x] = picture[y][x][0];
            }
        for (int k = 0; k < 4; k++) {
            const gait_image *const now = k & 1 ? &grey_frame : &frame, *const then =
                                                                            k & 2 ? &grey_scene : &scene;
            CHECK(gait_start_find_boxes(s, now, then, b[k], 2, &count, NULL) == GAIT_OK && count == (i == 0));
            CHECK(i || memcmp(b[k], b[0], sizeof b[k][0]) == 0);
        }
    }
    free(s);
}

/* Of too many people the largest are returned, the largest first, wherever they stand. */
static void test_the_largest_people(void)
{
    gait_start *const s = toy_start_new(camera(), ~0u);
    gait_image const scene = image_of(plate), frame = image_of(picture);
    static const int tall[5] = {70, 100, 80, 110, 60};
    gait_box b[3];
    int32_t count = -1;
    memset(plate, 90, sizeof plate);
    memset(picture, 90, sizeof picture);
    for (int i = 0; i < 5; i++)
        draw(20 + 60 * i, 44 + 60 * i, 170 - tall[i], 170, 200);
    CHECK(gait_start_find_boxes(s, &frame, &scene, b, 3, &count, NULL) == GAIT_OK && count == 3);
    CHECK_NEAR(b[0].foot[0], 32 + 60 * 3, 1.5);
    CHECK_NEAR(b[1].foot[0], 32 + 60 * 1, 1.5);
    CHECK_NEAR(b[2].foot[0], 32 + 60 * 2, 1.5);
    free(s);
}

/* Boxes of no person: too tall, too short, of no height, or too sparse. */
static void test_boxes_of_no_person(void)
{
    gait_start *const s = toy_start_new(camera(), ~0u);
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    int32_t count = 0;
    for (int n = 0; n < FRAMES; n++) {
        walk const giant = {.stature = 3.0f, .x = -1, .y = 6}, child = {.stature = 0.9f, .x = 1, .y = 6};
        gait_box b[3] = {box_of(&giant, 0, 0), box_of(&child, 0, 0), {{50, 100}, {50, 99.5f}, 1}};
        CHECK(gait_start_add_boxes(s, n * 40000, b, 3, NULL) == GAIT_OK);
    }
    CHECK(gait_start_solve(s, 0, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) == GAIT_ERR_STATE && count == 0);
    free(s);
}

static void test_refused(void)
{
    gait_start *const s = toy_start_new(camera(), ~0u);
    gait_image small = image_of(picture), scene = image_of(plate);
    gait_box b = {.sd = NAN};
    gait_hypothesis h;
    gait_error err = {0};
    int32_t count = 0;
    float stature;
    small.width = 16;
    CHECK(gait_start_find_boxes(s, &small, &scene, &b, 1, &count, &err) == GAIT_ERR_ARG);
    CHECK(strstr(err.text, "is 16 x 180, the camera is 320 x 180"));
    CHECK(gait_start_find_boxes(s, &scene, &scene, &b, 0, &count, &err) == GAIT_ERR_ARG);
    CHECK(gait_start_other_scene(s, &scene, &small, &count, &err) == GAIT_ERR_ARG);
    CHECK(gait_start_box_stature(s, &b, &stature, &err) == GAIT_ERR_ARG);
    CHECK(gait_start_add_boxes(s, 0, &b, -1, &err) == GAIT_ERR_ARG);
    CHECK(gait_start_add_boxes(s, 0, &b, 1, &err) == GAIT_OK); /* not a number: left out */
    CHECK(gait_start_add_boxes(s, 0, NULL, 0, &err) == GAIT_ERR_STATE && strstr(err.text, "utime"));
    CHECK(gait_start_solve(s, 0, &h, 1, &count, &err) == GAIT_ERR_STATE && strstr(err.text, "eight boxes"));
    free(s);
}

/* ---- the same bits ---- */
static uint64_t digest(uint32_t cpu_mask)
{
    walk const w[2] = {
        {.heading = 0.5f, .speed = 1.2f, .stature = 1.7f, .x = -0.5f, .y = 5.0f, .noise = 1.0f},
        {.stature = 1.8f, .x = 1.5f, .y = 6.0f, .noise = 1.0f}};
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    memset(h, 0, sizeof h);
    (void)find_by(cpu_mask, w, 2, h);
    return toy_hash_hypotheses(h);
}

#define GOLDEN UINT64_C(0x9c435a8555484387)

static void tests(void)
{
    test_headings();
    test_one_stands_and_one_walks();
    test_blobs();
    test_largest_change();
    test_formats_and_borders();
    test_the_largest_people();
    test_boxes_of_no_person();
    test_refused();
}

int main(int argc, char **argv)
{
    return golden_main(argc, argv, tests, digest, GOLDEN, "start_boxes");
}
