/* fuzz_snapshot.c - a damaged snapshot is refused, or else the tracker continues from it. */
#include "fuzz.h"
#include "base/hash.h"

#include "../unit/toy_classes.h"

#include <stdbool.h>

enum { BODY_AT = 48, HASH_AT = 40 };

/* Correct the checksum of what follows the header, so that the later checks are reached. */
static void repair(uint8_t *data, size_t size)
{
    if (size <= BODY_AT || (size - BODY_AT) % 32)
        return;
    uint64_t const hash = hash_state(data + BODY_AT, size - BODY_AT);
    memcpy(data + HASH_AT, &hash, sizeof hash);
}

enum { KINDS = 3 }; /* plain, with classes of motion, in paper mode */

static struct saved {
    gait_tracker *tracker;
    uint8_t *good, *work;
    size_t bytes;
} saved[KINDS];

static void prepare(struct saved *s, int kind)
{
    gait_tracker_config config = fuzz_config();
    const gait_model *const model = kind == 1 ? toy_classes_model() : toy_model();
    gait_state mean, sd;
    void *memory;
    config.mode = kind == 2 ? GAIT_MODE_PAPER : GAIT_MODE_DEFAULT;
    s->tracker = fuzz_tracker(model, &config, &memory);
    gait_tracker_prior(model, &mean, &sd, NULL);
    gait_tracker_start(s->tracker, &mean, &sd, 0, NULL);
    fuzz_steps(s->tracker, 0, 3, 1);
    gait_tracker_save(s->tracker, NULL, 0, &s->bytes, NULL);
    s->good = fuzz_memory(s->bytes);
    s->work = fuzz_memory(s->bytes);
    gait_tracker_save(s->tracker, s->good, s->bytes, &s->bytes, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_bytes b = {data, size};
    int const kind = fuzz_take(&b) % KINDS, pictures = fuzz_one_in(&b, 16);
    struct saved *const s = &saved[kind];
    if (!s->tracker)
        prepare(s, kind);
    memcpy(s->work, s->good, s->bytes);
    bool const damaged = b.left >= 8;
    size_t const left = fuzz_damage(s->work, s->bytes, &b);
    repair(s->work, left);
    uint8_t *const copy = fuzz_copy(s->work, left);
    if (gait_tracker_restore(s->tracker, copy, left, NULL) == GAIT_OK)
        fuzz_steps(s->tracker, 200000, 2, pictures);
    else if (!damaged)
        abort();
    free(copy);
    return 0;
}
