/* fuzz_start.c - any keypoints, boxes, images and times are refused, or give hypotheses that a tracker accepts. */
#include "gait_start.h"

#include "fuzz.h"

enum { FRAMES = 10 };

static void show(gait_start *s, fuzz_bytes *b, int64_t utime, uint8_t (*pixels)[FUZZ_WIDTH])
{
    gait_keypoint k[GAIT_MAX_JOINTS];
    gait_box boxes[GAIT_START_MAX_PEOPLE + 1];
    gait_image const image = {pixels[0], FUZZ_WIDTH, FUZZ_HEIGHT, FUZZ_WIDTH, GAIT_GREY8},
                     scene = {pixels[FUZZ_HEIGHT], FUZZ_WIDTH, FUZZ_HEIGHT, FUZZ_WIDTH, GAIT_GREY8};
    int32_t count = 0;
    float stature;
    for (int j = 0; j < GAIT_MAX_JOINTS; j++)
        k[j] = (gait_keypoint){fuzz_number(b), fuzz_number(b), fuzz_number(b)};
    uint8_t const what = fuzz_take(b);
    if (what % 2)
        gait_start_add(s, utime, k, NULL);
    for (int i = 0; i < 2 * FUZZ_HEIGHT; i++)
        for (int x = 0; x < FUZZ_WIDTH; x += 16)
            memset(&pixels[i][x], fuzz_take(b), 16);
    if (what % 8 > 5 && /* pictures take two thirds of the time */
        gait_start_find_boxes(s, &image, &scene, boxes, GAIT_START_MAX_PEOPLE, &count, NULL) != GAIT_OK)
        abort();
    for (; count <= GAIT_START_MAX_PEOPLE && fuzz_take(b) % 3; count++) {
        boxes[count] =
            (gait_box){{fuzz_number(b), fuzz_number(b)}, {fuzz_number(b), fuzz_number(b)}, fuzz_number(b)};
        gait_start_box_stature(s, &boxes[count], &stature, NULL);
    }
    gait_start_add_boxes(s, utime, boxes, count, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t pixels[2 * FUZZ_HEIGHT][FUZZ_WIDTH];
    gait_start_config cfg;
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    gait_start *s = NULL;
    fuzz_bytes b = {data, size};
    size_t need = 0;
    int const solved = fuzz_one_in(&b, 32); /* the search takes long */
    int32_t count = 0;
    void *memory = NULL;
    gait_start_default(&cfg);
    if (fuzz_take(&b) > 240) { /* mostly refused */
        cfg.stature = fuzz_number(&b);
        cfg.box_time = fuzz_number(&b);
    }
    cfg.box_time = cfg.box_time == 1.0f ? 0.3f : cfg.box_time;
    cfg.camera = fuzz_camera();
    if (fuzz_take(&b) > 200)
        cfg.camera.t[0] = cfg.camera.distortion[0] = fuzz_number(&b);
    gait_camera_check(&cfg.camera, NULL);
    if (gait_start_bytes(toy_model(), &cfg, &need, NULL) != GAIT_OK)
        return 0;
    memory = fuzz_memory(need);
    if (memory && gait_start_init(memory, need, toy_model(), &cfg, &s, NULL) == GAIT_OK)
        for (int64_t n = 0, utime = 0; n < FRAMES; n++, utime += 30000 + 300 * (int64_t)fuzz_take(&b))
            show(s, &b, utime, pixels);
    if (s && solved && gait_start_solve(s, 0, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) == GAIT_OK) {
        gait_tracker_config const config = fuzz_config();
        void *own;
        gait_tracker *const t = fuzz_tracker(toy_model(), &config, &own);
        for (int32_t i = 0; i < count && t; i++)
            if (gait_tracker_start_hypotheses(t, h + i, count - i, 0, NULL) != GAIT_OK)
                abort();
        free(own);
    }
    free(memory);
    return 0;
}
