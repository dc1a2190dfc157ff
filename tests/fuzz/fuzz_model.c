/* fuzz_model.c - a damaged model is refused, or else can be used: pose, picture, tracking. */
#include "fuzz.h"

#include <stdlib.h>

enum { WIDTH = 64, HEIGHT = 48 };

void fuzz_seed(const uint8_t *blob, size_t blob_size, uint8_t *out, size_t cap, size_t *size)
{
    if (blob_size > cap)
        abort();
    memcpy(out, blob, blob_size);
    fuzz_repair(out, blob_size);
    if (memcmp(out, blob, blob_size) != 0) /* else every damaged model would be refused for its checksum */
        abort();
    *size = blob_size;
}

static void use(const gait_model *m)
{
    static uint8_t ids[WIDTH * HEIGHT];
    gait_camera const cam = {WIDTH, HEIGHT, 80, 80, 32, 24, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};
    gait_state mean, sd;
    gait_pose pose;
    void *memory = NULL;
    if (gait_tracker_prior(m, &mean, &sd, NULL) != GAIT_OK)
        return;
    for (int i = 0; i < 3; i++) {
        mean.phase = 0.33f * (float)i;
        gait_model_pelvis_height(m, &mean, &mean.pelvis[2], NULL);
        gait_model_pose(m, &mean, &pose, NULL);
        gait_render(m, &cam, &mean, ids, WIDTH, NULL);
    }
    gait_tracker *const t = fuzz_tracker(m, &memory);
    if (t)
        fuzz_steps(t, &mean, &sd, 0, 3);
    free(memory);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    void *copy = NULL;
    uint8_t *const blob = fuzz_aligned(data, size, &copy);
    size_t bytes = 0;
    gait_model *m = NULL;
    fuzz_repair(blob, size);
    if (gait_model_bytes(blob, size, &bytes, NULL) == GAIT_OK) {
        void *const memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN) / GAIT_ALIGN * GAIT_ALIGN);
        if (memory && gait_model_init(memory, bytes, blob, size, &m, NULL) == GAIT_OK)
            use(m);
        free(memory);
    }
    free(copy);
    return 0;
}
