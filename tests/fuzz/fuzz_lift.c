/* fuzz_lift.c - any settings, keypoints, standard deviations and times of a lifter are refused, or the result is finite. */
#include "gait_lift.h"

#include "fuzz.h"

#include "../unit/toy_segment.h"

static const gait_model *segment_model(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char blob[TOY_BYTES], memory[1 << 16];
    static toy_segments s;
    static gait_model *m;
    if (!m) {
        toy_segments_fill(&s, 1, 0);
        if (gait_model_init(memory, sizeof memory, blob, toy_segments_write(blob, &s), &m, NULL) != GAIT_OK)
            abort();
    }
    return m;
}

static void check_finite(const double *x, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(x[i]))
            abort();
}

/* The numbers of one frame or segment: most are plausible, those from the input are arbitrary. */
static void fill(double *uv, double *sd, int points, fuzz_bytes *b)
{
    for (int i = 0; i < points; i++) {
        uv[2 * i] = 24.0 + i % 7;
        uv[2 * i + 1] = 8.0 + i % 13;
        sd[i] = 2.0;
    }
    for (uint8_t left = fuzz_take(b) % 16; left > 0; left--) {
        int const i = fuzz_take(b) % points;
        uv[2 * i] = (double)fuzz_number(b);
        uv[2 * i + 1] = (double)fuzz_number(b);
        sd[i] = (double)fuzz_number(b);
        if (fuzz_take(b) > 192)
            sd[i] *= 1e-12;
    }
}

static void lift(gait_lift *l, fuzz_bytes *b)
{
    static double uv[2 * TOY_SEGMENT], sd[TOY_SEGMENT], mean[3 * TOY_SEGMENT], sds[3 * TOY_SEGMENT];
    static gait_lift_frame out;
    gait_lift_fit fit;
    int64_t utime = 1;
    fill(uv, sd, TOY_SEGMENT, b);
    if (gait_lift_segment(l, uv, sd, &fit, NULL) == GAIT_OK &&
        gait_lift_positions(l, mean, sds, NULL) == GAIT_OK) {
        check_finite(mean, 3 * TOY_SEGMENT);
        check_finite(sds, 3 * TOY_SEGMENT);
    }
    for (int n = 0; n < 12 && b->left > 0; n++) {
        uint8_t const what = fuzz_take(b);
        fill(uv, sd, TOY_MARKERS, b);
        utime = (int64_t)((uint64_t)utime + (what > 240 ? (uint64_t)fuzz_word(b) << (what % 33) : 50000));
        if (gait_lift_push(l, utime, uv, what % 4 ? sd : NULL, NULL) == GAIT_OK &&
            gait_lift_estimate(l, &out, NULL) == GAIT_OK) {
            check_finite(out.marker[0], 3 * TOY_MARKERS);
            check_finite(out.sd[0], 3 * TOY_MARKERS);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_bytes b = {data, size};
    gait_lift_config c;
    gait_lift *l = NULL;
    size_t bytes = 0;
    uint8_t const choice = fuzz_take(&b);
    gait_lift_default(&c);
    c.projection = choice & 1 ? GAIT_LIFT_ORTHOGRAPHIC : GAIT_LIFT_PERSPECTIVE;
    c.heading_sd = choice % 16 == 2 ? -1.0 : 0.3; /* searching all headings takes long */
    c.max_iterations = 3;
    c.camera = fuzz_camera();
    fuzz_settings("gait_lift_config", &c, &b);
    fuzz_settings("gait_camera", &c.camera, &b);
    if (gait_lift_bytes(segment_model(), &c, &bytes, NULL) != GAIT_OK)
        return 0;
    void *const memory = fuzz_memory(bytes);
    if (memory && gait_lift_init(memory, bytes, segment_model(), &c, &l, NULL) == GAIT_OK)
        lift(l, &b);
    free(memory);
    return 0;
}
