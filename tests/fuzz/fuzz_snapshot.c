/* fuzz_snapshot.c - a damaged snapshot is refused, or else the tracker goes on from it. */
#include "fuzz.h"
#include "base/hash.h"

enum { BODY_AT = 48, HASH_AT = 40 };

/* The checksum of what follows the header, so that the checks behind it are reached. */
static void repair(uint8_t *data, size_t size)
{
    if (size <= BODY_AT || (size - BODY_AT) % 32)
        return;
    uint64_t const hash = hash_state(data + BODY_AT, size - BODY_AT);
    memcpy(data + HASH_AT, &hash, sizeof hash);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static gait_tracker *tracker;
    static uint8_t *good, *work;
    static size_t bytes;
    void *memory;
    fuzz_bytes b = {data, size};
    if (!tracker) {
        gait_tracker_config const config = fuzz_config();
        gait_state mean, sd;
        tracker = fuzz_tracker(toy_model(), &config, &memory);
        gait_tracker_prior(toy_model(), &mean, &sd, NULL);
        gait_tracker_start(tracker, &mean, &sd, 0, NULL);
        fuzz_steps(tracker, 0, 3);
        gait_tracker_save(tracker, NULL, 0, &bytes, NULL);
        good = fuzz_memory(bytes);
        work = fuzz_memory(bytes);
        gait_tracker_save(tracker, good, bytes, &bytes, NULL);
    }
    memcpy(work, good, bytes);
    size_t const left = fuzz_damage(work, bytes, &b);
    repair(work, left);
    uint8_t *const copy = fuzz_copy(work, left);
    if (gait_tracker_restore(tracker, copy, left, NULL) == GAIT_OK)
        fuzz_steps(tracker, 200000, 2);
    else if (size < 8) /* not damaged */
        abort();
    free(copy);
    return 0;
}
