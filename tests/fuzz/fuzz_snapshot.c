/* fuzz_snapshot.c - a damaged snapshot is refused, or else the tracker goes on from it. */
#include "fuzz.h"
#include "base/hash.h"

#include <stdlib.h>
#include <string.h>

enum { BODY_AT = 48, HASH_AT = 40, MODEL_BYTES = 1 << 20 };

static gait_tracker *tracker;

/* The checksum of what follows the header, so that the checks behind it are reached. */
static void repair(uint8_t *data, size_t size)
{
    if (size <= BODY_AT || (size - BODY_AT) % 32)
        return;
    uint64_t const hash = hash_state(data + BODY_AT, size - BODY_AT);
    memcpy(data + HASH_AT, &hash, sizeof hash);
}

void fuzz_seed(const uint8_t *blob, size_t blob_size, uint8_t *out, size_t cap, size_t *size)
{
    static _Alignas(GAIT_ALIGN) uint8_t model_memory[MODEL_BYTES];
    static void *copy, *memory;
    gait_model *model = NULL;
    gait_state mean, sd;
    if (gait_model_init(model_memory, sizeof model_memory, fuzz_aligned(blob, blob_size, &copy), blob_size,
                        &model, NULL) != GAIT_OK ||
        gait_tracker_prior(model, &mean, &sd, NULL) != GAIT_OK || !(tracker = fuzz_tracker(model, &memory)))
        abort();
    fuzz_steps(tracker, &mean, &sd, 0, 3);
    if (gait_tracker_save(tracker, out, cap, size, NULL) != GAIT_OK)
        abort();
    memset(out + HASH_AT, 0, sizeof(uint64_t));
    repair(out, *size);
    if (gait_tracker_restore(tracker, out, *size, NULL) != GAIT_OK)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    void *memory = NULL;
    uint8_t *const copy = fuzz_aligned(data, size, &memory);
    repair(copy, size);
    if (gait_tracker_restore(tracker, copy, size, NULL) == GAIT_OK)
        fuzz_steps(tracker, NULL, NULL, 200000, 2);
    free(memory);
    return 0;
}
