/* fuzz_start.c - any keypoints, boxes, images and times are refused, or give hypotheses that a tracker accepts. */
#include "gait_start.h"

#include "fuzz.h"

#include <math.h>
#include <stdlib.h>

enum { WIDTH = 48, HEIGHT = 32, FRAMES = 24 };

static gait_model *model_of(const uint8_t *blob, size_t size)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[1 << 20];
    static gait_model *m;
    if (!m && gait_model_init(memory, sizeof memory, blob, size, &m, NULL) != GAIT_OK)
        abort();
    return m;
}

static const gait_model *shipped; /* set by fuzz_seed(), whose blob outlives the run */

/* The seed: bytes that give plausible numbers. */
void fuzz_seed(const uint8_t *blob, size_t blob_size, uint8_t *out, size_t cap, size_t *size)
{
    static void *copy;
    shipped = model_of(fuzz_aligned(blob, blob_size, &copy), blob_size);
    *size = cap < 16384 ? cap : 16384;
    for (size_t i = 0; i < *size; i++)
        out[i] = (uint8_t)(i * 37 + i / 7 + i * i / 256);
}

typedef struct bytes {
    const uint8_t *at;
    size_t left;
} bytes;

static uint8_t take(bytes *b)
{
    if (b->left == 0)
        return 0;
    b->left--;
    return *b->at++;
}

/* A number about the picture, or now and then one that no picture has. */
static float number(bytes *b)
{
    static const float SPECIAL[] = {NAN, INFINITY, -INFINITY, 3e38f, -1e30f, 1e-38f, 0.0f, -0.0f};
    uint8_t const k = take(b);
    return k < 8 ? SPECIAL[k] : (float)k * 0.25f - 4.0f + (float)take(b) * 0.01f;
}

static void show(gait_start *s, bytes *b, int64_t utime, uint8_t (*pixels)[WIDTH])
{
    gait_keypoint k[GAIT_MAX_JOINTS];
    gait_box boxes[GAIT_START_MAX_PEOPLE + 1];
    gait_image const image = {pixels[0], WIDTH, HEIGHT, WIDTH, GAIT_GREY8},
                     scene = {pixels[HEIGHT], WIDTH, HEIGHT, WIDTH, GAIT_GREY8};
    int32_t count = 0;
    float stature;
    for (int j = 0; j < GAIT_MAX_JOINTS; j++)
        k[j] = (gait_keypoint){number(b), number(b), number(b)};
    if (take(b) % 2)
        gait_start_add(s, utime, k, NULL);
    for (int i = 0; i < 2 * HEIGHT; i++)
        for (int x = 0; x < WIDTH; x += 16)
            pixels[i][x] = take(b);
    if (gait_start_find_boxes(s, &image, &scene, boxes, GAIT_START_MAX_PEOPLE, &count, NULL) != GAIT_OK)
        abort();
    for (; count <= GAIT_START_MAX_PEOPLE && take(b) % 3; count++) {
        boxes[count] = (gait_box){{number(b), number(b)}, {number(b), number(b)}, number(b)};
        gait_start_box_stature(s, &boxes[count], &stature, NULL);
    }
    gait_start_add_boxes(s, utime, boxes, count, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t pixels[2 * HEIGHT][WIDTH];
    gait_start_config cfg;
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    gait_start *s = NULL;
    bytes b = {data, size};
    size_t need = 0;
    int32_t count = 0;
    void *memory = NULL;
    if (!shipped)
        return 0;
    gait_start_default(&cfg);
    if (take(&b) > 240) { /* mostly refused */
        cfg.stature = number(&b);
        cfg.box_time = number(&b);
    }
    cfg.box_time = cfg.box_time == 1.0f ? 0.3f : cfg.box_time;
    cfg.camera =
        (gait_camera){WIDTH, HEIGHT, 40, 40, 24, 16, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0.0f, 1.5f, 5}, {0}};
    if (take(&b) > 200)
        cfg.camera.t[0] = cfg.camera.distortion[0] = number(&b);
    if (gait_start_bytes(shipped, &cfg, &need, NULL) != GAIT_OK)
        return 0;
    memory = aligned_alloc(GAIT_ALIGN, (need + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
    if (memory && gait_start_init(memory, need, shipped, &cfg, &s, NULL) == GAIT_OK)
        for (int64_t n = 0, utime = 0; n < FRAMES; n++, utime += 20000 + 300 * (int64_t)take(&b))
            show(s, &b, utime, pixels);
    if (s && gait_start_solve(s, 0, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) == GAIT_OK) {
        void *own = NULL;
        gait_tracker *const t = fuzz_tracker(shipped, &own);
        for (int32_t i = 0; i < count && t; i++)
            if (gait_tracker_start_hypotheses(t, h + i, count - i, 0, NULL) != GAIT_OK)
                abort();
        free(own);
    }
    free(memory);
    return 0;
}
