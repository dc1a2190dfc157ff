/* Bits of the body's rows, of the field of view and of the foreground, counted together. */
#include "features.h"
#include "kernels.h"

void KERNEL(silhouette_count)(const features *f, const rast_mask *whole, int32_t *area, int32_t *covered)
{
    int32_t const first = whole->first * RAST_WORDS, last = whole->last * RAST_WORDS;
    const uint64_t *const body = (const uint64_t *)whole->row, *const inside = (const uint64_t *)f->inside;
    const uint64_t *const fg = (const uint64_t *)f->fg;
    int64_t cells = 0, part[FG_PLANES] = {0};
    for (int32_t i = first; i < last; i++) {
        uint64_t const m = body[i] & inside[i];
        cells += rast_popcount(m);
        for (int32_t k = 0; k < FG_PLANES; k++)
            part[k] += rast_popcount(m & fg[k * RAST_SIZE * RAST_WORDS + i]);
    }
    int64_t sum = 0;
    for (int32_t k = 0; k < FG_PLANES; k++)
        sum += part[k] << k;
    *area = (int32_t)cells * FG_ONE;
    *covered = (int32_t)sum;
}
