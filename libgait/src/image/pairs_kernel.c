/* Values with those below them, for bilinear look-up in one word. */
#include "image/features.h"
#include "base/dispatch.h"

enum { COUNT = VIEW_PIXELS - VIEW_SIZE, SIMD16 = 64 };

KERNEL_ROW void pack(const uint8_t *restrict p, uint16_t *restrict pairs)
{
    for (int32_t i = 0; i < SIMD16; i++)
        pairs[i] = (uint16_t)(p[i] | p[i + VIEW_SIZE] << 8);
}

/* Those of the last row are missing; nobody looks there. */
void KERNEL(features_pairs)(const int8_t *surface, uint16_t *pairs)
{
    for (int32_t i = 0; i < COUNT; i += SIMD16)
        pack((const uint8_t *)surface + i, pairs + i);
}
