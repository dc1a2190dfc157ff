/* fuzz_model.c - a damaged model is refused, or else can be used: pose, picture, tracking, lifting. */
#include "fuzz.h"
#include "base/hash.h"

#include "../unit/toy_classes.h"
#include "../unit/toy_segment.h"

#include <stdbool.h>

enum { KINDS = 3 };

/* One of three good models; the shipped ones have the same sections. */
static size_t write_model(uint8_t *out, int which)
{
    static toy_segments segments;
    toy_classes_spec const classes = toy_classes_usual();
    if (which == 0)
        return toy_write(out, TOY_PHASES, TOY_COMPONENTS);
    if (which == 1)
        return toy_classes_write(out, &classes);
    toy_segments_fill(&segments, 2, 0);
    return toy_segments_write(out, &segments);
}

/* Copy that model; each is written once. */
static size_t copy_model(uint8_t *out, int which)
{
    static uint8_t good[KINDS][TOY_BYTES];
    static size_t bytes[KINDS];
    if (!bytes[which])
        bytes[which] = write_model(good[which], which);
    memcpy(out, good[which], bytes[which]);
    return bytes[which];
}

/* Correct the checksum as toy_seal() does, faster. */
static void seal(uint8_t *data, size_t size)
{
    memset(data + 20, 0, 4);
    toy_put(data + 20, hash_crc32(0, data, size), 4);
}

static void track(const gait_model *m, int pictures)
{
    static uint8_t ids[FUZZ_WIDTH * FUZZ_HEIGHT];
    gait_camera const camera = fuzz_camera();
    gait_tracker_config const config = fuzz_config();
    gait_state mean, sd;
    gait_pose pose;
    void *memory;
    if (gait_tracker_prior(m, &mean, &sd, NULL) != GAIT_OK)
        return;
    for (int i = 0; i < 2; i++) {
        mean.phase = 0.4f * (float)i;
        gait_model_pelvis_height(m, &mean, &mean.pelvis[2], NULL);
        gait_model_pose(m, &mean, &pose, NULL);
        if (pictures)
            gait_render(m, &camera, &mean, ids, FUZZ_WIDTH, NULL);
    }
    gait_tracker *const t = fuzz_tracker(m, &config, &memory);
    if (t && gait_tracker_start(t, &mean, &sd, 0, NULL) == GAIT_OK)
        fuzz_steps(t, 0, 2, pictures);
    free(memory);
}

static void lift(const gait_model *m, bool perspective)
{
    enum { POINTS = GAIT_MAX_SEGMENT_FRAMES * GAIT_MAX_MARKERS };
    static double uv[2 * POINTS], mean[3 * POINTS], sd[3 * POINTS];
    static gait_lift_frame out;
    gait_lift_config c;
    gait_lift_fit fit;
    gait_lift *l = NULL;
    size_t bytes = 0;
    gait_lift_default(&c);
    c.projection = perspective ? GAIT_LIFT_PERSPECTIVE : GAIT_LIFT_ORTHOGRAPHIC;
    c.heading_sd = 0.3; /* searching all headings takes long */
    c.max_iterations = 3;
    c.camera = fuzz_camera();
    if (gait_lift_bytes(m, &c, &bytes, NULL) != GAIT_OK)
        return;
    void *const memory = fuzz_memory(bytes);
    if (memory && gait_lift_init(memory, bytes, m, &c, &l, NULL) == GAIT_OK) {
        for (int i = 0; i < 2 * POINTS; i++)
            uv[i] = 20.0 + i % 17;
        if (gait_lift_segment(l, uv, NULL, &fit, NULL) == GAIT_OK)
            gait_lift_positions(l, mean, sd, NULL);
        for (int i = 0; i < 12; i++) {
            gait_lift_push(l, 1 + (int64_t)i * 33333, uv, NULL, NULL);
            gait_lift_estimate(l, &out, NULL);
        }
    }
    free(memory);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t made[TOY_BYTES];
    fuzz_bytes b = {data, size};
    uint8_t const choice = fuzz_take(&b);
    int const pictures = fuzz_one_in(&b, 16);
    size_t const left = fuzz_damage(made, copy_model(made, choice % KINDS), &b);
    if (left >= 24)
        seal(made, left); /* otherwise all would be refused for their checksums */
    uint8_t *const blob = fuzz_copy(made, left);
    size_t bytes = 0;
    gait_model *m = NULL;
    if (gait_model_bytes(blob, left, &bytes, NULL) == GAIT_OK) {
        void *const memory = fuzz_memory(bytes);
        gait_lift_info info;
        if (memory && gait_model_init(memory, bytes, blob, left, &m, NULL) == GAIT_OK) {
            track(m, pictures);
            if (gait_lift_get_info(m, &info, NULL) == GAIT_OK)
                lift(m, choice / KINDS % 2);
        }
        free(memory);
    }
    free(blob);
    return 0;
}
