/* toy_visible.h - visibility of a single point of a drawn body, the reference for kernels that test many. */
#ifndef TOY_VISIBLE_H
#define TOY_VISIBLE_H
#include "raster/layers.h"

/* Whether the mask contains this cell. */
static inline bool toy_cell(const grid_mask *m, int32_t x, int32_t y)
{
    int32_t const c = x - m->column;
    return y >= m->first && y < m->last && c >= 0 && c < m->width && (m->word[c >> 6][y] >> (c & 63) & 1);
}

/* Whether the limb is visible at this working pixel. */
static inline bool toy_visible(const grid_mask *mask, float wx, float wy)
{
    /* Truncation is fine: positions left of or above the grid are rejected first. */
    if (!(wx >= 0.0f && wy >= 0.0f && wx < (float)VIEW_SIZE && wy < (float)VIEW_SIZE))
        return false;
    int32_t const x = (int32_t)wx >> 1, y = (int32_t)wy >> 1;
    return toy_cell(mask, x, y);
}
#endif
