/* Neighbours for bilinear look-up in one word. */
#include "features.h"
#include "kernels.h"

/* Those of the last row are missing; nobody looks there. */
void KERNEL(features_quads)(const int8_t *surface, uint32_t *restrict quads)
{
    const uint8_t *const p = (const uint8_t *)surface;
    for (int32_t i = 0; i < VIEW_PIXELS - VIEW_SIZE - 1; i++)
        quads[i] = p[i] | (uint32_t)p[i + 1] << 8 | (uint32_t)p[i + VIEW_SIZE] << 16 |
                   (uint32_t)p[i + VIEW_SIZE + 1] << 24;
}
