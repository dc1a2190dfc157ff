/* Regions that differ from the background: which are like people, the largest first, and when the scene is another one. */
#include "start/blobs.h"

#include "check.h"

#include <stdlib.h>

enum { WIDTH = 160, HEIGHT = 120 };

static uint8_t scene[WIDTH * HEIGHT], image[WIDTH * HEIGHT];
static blob_finder finder;

static gait_image picture(const uint8_t *data)
{
    return (gait_image){data, WIDTH, HEIGHT, WIDTH, GAIT_GREY8};
}

static void draw(int x, int y, int width, int height)
{
    for (int v = y; v < y + height; v++)
        memset(image + v * WIDTH + x, 200, (size_t)width);
}

static int32_t find(gait_box *out, int32_t capacity)
{
    gait_image const now = picture(image), empty = picture(scene);
    return blob_find(&finder, &now, &empty, out, capacity);
}

static void begin(void)
{
    memcpy(image, scene, sizeof image);
}

/* A standing person in full view is one; the same touching a side of the picture, lying, small or hollow is none. */
static void test_shapes(void)
{
    static const struct {
        int x, y, width, height;
        bool person;
    } shapes[] = {
        {60, 40, 12, 40, true},           {0, 40, 12, 40, false},
        {WIDTH - 12, 40, 12, 40, false},  {60, 0, 12, 40, false},
        {60, HEIGHT - 40, 12, 40, false}, {60, 40, 40, 12, false},
        {60, 40, 30, 30, false},          {60, 40, 6, 9, false},
    };
    gait_box out[4];
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        begin();
        draw(shapes[i].x, shapes[i].y, shapes[i].width, shapes[i].height);
        CHECK(find(out, 4) == shapes[i].person);
    }
    begin();
    draw(60, 40, 12, 40);
    CHECK(find(out, 4) == 1);
    CHECK_NEAR(out[0].foot[0], 65.5, 1.5);
    CHECK_NEAR(out[0].foot[1], 79.5, 2);
    CHECK_NEAR(out[0].head[1], 39.5, 2);
    begin(); /* a frame of thin lines */
    draw(30, 4, 90, 1);
    draw(30, 113, 90, 1);
    draw(30, 4, 1, 110);
    draw(119, 4, 1, 110);
    CHECK(find(out, 4) == 0);
}

/* More people than the caller, or the library, can take: the largest, in order, from wherever they stand. */
static void test_largest(void)
{
    static const int height[] = {30, 50, 40, 60, 35, 45};
    enum { PEOPLE = sizeof height / sizeof *height };
    gait_box out[PEOPLE];
    begin();
    for (int i = 0; i < PEOPLE; i++)
        draw(8 + 24 * i, 20, 12, height[i]);
    for (int capacity = 1; capacity <= PEOPLE; capacity++) {
        int32_t const n = find(out, capacity),
                      most = capacity < GAIT_START_MAX_PEOPLE ? capacity : GAIT_START_MAX_PEOPLE;
        static const int order[] = {3, 1, 5, 2};
        CHECK(n == most);
        for (int k = 0; k < n; k++)
            CHECK_NEAR(out[k].foot[0], 8 + 24 * order[k] + 5.5, 1.5);
    }
}

static void test_scene(void)
{
    gait_image const empty = picture(scene);
    gait_image now = picture(image);
    gait_box out[4];
    begin();
    CHECK(!blob_other_scene(&finder, &now, &empty) && find(out, 4) == 0);
    draw(60, 40, 12, 40);
    CHECK(!blob_other_scene(&finder, &now, &empty));
    for (int i = 0; i < WIDTH * HEIGHT; i++) /* brighter all over: the same scene */
        image[i] = (uint8_t)(scene[i] + 40);
    CHECK(!blob_other_scene(&finder, &now, &empty) && find(out, 4) == 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        image[i] = (uint8_t)(i / 40 % 2 ? 250 - scene[i] : scene[i] / 2);
    CHECK(blob_other_scene(&finder, &now, &empty));
    begin();
    draw(20, 30, 12, 40);
    draw(60, 5, 90, 100); /* a door that is open: most of what has changed is no person */
    CHECK(find(out, 4) == 0);
}

int main(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[WIDTH * HEIGHT * 16];
    arena a = {.base = memory, .cap = sizeof memory};
    finder = blob_finder_layout(&a, WIDTH, HEIGHT);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        scene[i] = (uint8_t)(40 + i * 37 % 5 + i % WIDTH / 4);
    CHECK(!a.overflow && finder.step == 1);
    test_shapes();
    test_largest();
    test_scene();
    return CHECK_DONE();
}
