/* layers.h - one body's limbs drawn into the grid with depth order: what of each limb can be seen. */
#ifndef GAIT_LAYERS_H
#define GAIT_LAYERS_H
#include "outline.h"

typedef struct layers {
    rast_mask visible[MODEL_MAX_LIMBS]; /* by limb; rows outside its [first, last) are not written */
    rast_mask whole;                    /* the body; every row of the grid is written */
} layers;

/* Limb indices from near to far by depth[l * stride]; limbs behind the camera (depth 0) are left out.
 * Returns how many there are. */
int32_t layers_order(const float *depth, int32_t stride, int32_t limbs, int32_t *order);

/* Polygon of one limb of one lane in grid cells (two working pixels each). */
void layers_polygon(const outline_block *outline, int32_t limb, int32_t vertices, int32_t lane, float *x,
                    float *y);

void layers_draw(const outline_block *outline, const limb_geometry *limbs, int32_t count, int32_t lane,
                 layers *out);

/* Is the limb visible at this working pixel? */
static inline bool layers_visible(const rast_mask *mask, float wx, float wy)
{
    /* Truncation is fine: cells left of or above the grid are refused first. */
    if (!(wx >= 0.0f && wy >= 0.0f && wx < (float)VIEW_SIZE && wy < (float)VIEW_SIZE))
        return false;
    int32_t const x = (int32_t)wx >> 1, y = (int32_t)wy >> 1;
    return y >= mask->first && y < mask->last && (mask->row[y][x >> 6] >> (x & 63) & 1);
}
#endif
