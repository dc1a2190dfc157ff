/* fuzz.h - a fuzz target: its seed, and what to do with damaged copies of it.  standalone.c drives it under the
 * sanitizers; LLVMFuzzerTestOneInput lets libFuzzer do so as well. */
#ifndef FUZZ_H
#define FUZZ_H
#include "gait.h"
#include "base/hash.h"

#include <string.h>

/* Make the checksum of a damaged blob right, else it would be refused for that. */
static inline void fuzz_repair(uint8_t *data, size_t size)
{
    enum { CRC_AT = 20 };
    if (size < CRC_AT + 4)
        return;
    memset(data + CRC_AT, 0, 4);
    uint32_t const crc = hash_crc32(0, data, size);
    memcpy(data + CRC_AT, &crc, sizeof crc);
}

/* A valid input, checked to be accepted, made from the shipped model's blob; *size at most cap. */
void fuzz_seed(const uint8_t *blob, size_t blob_size, uint8_t *out, size_t cap, size_t *size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Copy into memory that ends where the input ends (an overrun is noticed), aligned to GAIT_ALIGN; free() it. */
uint8_t *fuzz_aligned(const uint8_t *data, size_t size, void **memory);

/* A small tracker of this model in its own memory, or NULL. */
gait_tracker *fuzz_tracker(const gait_model *model, void **memory);

/* Start it and let it see some frames. */
void fuzz_steps(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime, int frames);
#endif
