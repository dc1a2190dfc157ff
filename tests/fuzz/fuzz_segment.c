/* fuzz_segment.c - a damaged segment prior is refused, or else can be lifted with. */
#include "gait_lift.h"

#include "fuzz.h"

#include <stdlib.h>

enum { POINTS = GAIT_MAX_SEGMENT_FRAMES * GAIT_MAX_MARKERS };

static gait_model *read_model(const uint8_t *blob, size_t size)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[1 << 20];
    gait_model *m = NULL;
    return gait_model_init(memory, sizeof memory, blob, size, &m, NULL) == GAIT_OK ? m : NULL;
}

void fuzz_seed(const uint8_t *blob, size_t blob_size, uint8_t *out, size_t cap, size_t *size)
{
    gait_lift_info info;
    void *copy = NULL;
    if (blob_size > cap || gait_lift_get_info(read_model(fuzz_aligned(blob, blob_size, &copy), blob_size),
                                              &info, NULL) != GAIT_OK)
        abort();
    free(copy);
    memcpy(out, blob, blob_size);
    *size = blob_size;
}

static void use(const gait_model *m, uint64_t choice)
{
    static double uv[2 * POINTS], mean[3 * POINTS], sd[3 * POINTS];
    static gait_lift_frame out;
    gait_lift_config c;
    gait_lift_fit fit;
    gait_lift *l = NULL;
    size_t bytes = 0;
    gait_lift_default(&c);
    c.projection = choice % 2 ? GAIT_LIFT_PERSPECTIVE : GAIT_LIFT_ORTHOGRAPHIC;
    c.heading_sd = choice / 2 % 4 ? 0.3 : -1.0; /* looking all round takes long */
    c.max_iterations = 4;
    c.camera = (gait_camera){96, 64, 100, 100, 48, 32, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};
    if (gait_lift_bytes(m, &c, &bytes, NULL) != GAIT_OK || bytes > 1u << 27)
        return;
    void *const memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN) / GAIT_ALIGN * GAIT_ALIGN);
    if (memory && gait_lift_init(memory, bytes, m, &c, &l, NULL) == GAIT_OK) {
        for (int i = 0; i < 2 * POINTS; i++)
            uv[i] = 40.0 + i % 17;
        if (gait_lift_segment(l, uv, NULL, &fit, NULL) == GAIT_OK)
            gait_lift_positions(l, mean, sd, NULL);
        for (int i = 0; i < 40; i++) {
            gait_lift_push(l, 1 + (int64_t)i * 33333, uv, NULL, NULL);
            gait_lift_estimate(l, &out, NULL);
        }
    }
    free(memory);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    void *copy = NULL;
    uint8_t *const blob = fuzz_aligned(data, size, &copy);
    gait_lift_info info;
    fuzz_repair(blob, size);
    const gait_model *const m = read_model(blob, size);
    if (m && gait_lift_get_info(m, &info, NULL) == GAIT_OK)
        use(m, info.digest);
    free(copy);
    return 0;
}
