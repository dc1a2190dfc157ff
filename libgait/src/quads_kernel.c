/* Neighbours for bilinear look-up in one word. */
#include "features.h"
#include "kernels.h"

enum { COUNT = VIEW_PIXELS - VIEW_SIZE - 1, LANES = 64 };

KERNEL_ROW void pack(const uint8_t *restrict p, uint32_t *restrict quads)
{
    for (int32_t i = 0; i < LANES; i++)
        quads[i] = p[i] | (uint32_t)p[i + 1] << 8 | (uint32_t)p[i + VIEW_SIZE] << 16 |
                   (uint32_t)p[i + VIEW_SIZE + 1] << 24;
}

/* Those of the last row are missing; nobody looks there.  The last LANES overlap those before, so that there is no
 * remainder. */
void KERNEL(features_quads)(const int8_t *surface, uint32_t *quads)
{
    for (int32_t i = 0; i < COUNT; i += LANES) {
        int32_t const at = i_min(i, COUNT - LANES);
        pack((const uint8_t *)surface + at, quads + at);
    }
}
