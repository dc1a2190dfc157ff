/* Area and foreground of a body: bits of its rows, of the field of view and of the foreground, counted
 * together. */
#include "image/features.h"
#include "base/dispatch.h"

void KERNEL(silhouette_count)(const features *f, const grid_mask *whole, int32_t *area, int32_t *covered)
{
    int64_t cells = 0, part[FOREGROUND_PLANES] = {0}, sum = 0;
    for (int32_t w = 0; 64 * w < whole->width; w++) {
        const uint64_t (*const words)[GRID_SIZE] =
            (const uint64_t (*)[GRID_SIZE])f->words[(whole->column + 64 * w) / GRID_STEP];
        const uint64_t *const body = whole->word[w], *const inside = words[FOREGROUND_PLANES];
        for (int32_t y = whole->first; y < whole->last; y++) {
            uint64_t const m = body[y] & inside[y];
            cells += grid_popcount(m);
            for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
                part[k] += grid_popcount(m & words[k][y]);
        }
    }
    for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
        sum += part[k] << k;
    *area = (int32_t)cells * FOREGROUND_ONE;
    *covered = (int32_t)sum;
}
