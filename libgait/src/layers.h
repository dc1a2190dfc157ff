/* layers.h - one body's limbs drawn into the grid with depth order: what of each limb can be seen. */
#ifndef GAIT_LAYERS_H
#define GAIT_LAYERS_H
#include "outline.h"

enum { LAYERS_ROWS = 8 }; /* the grid is drawn in bands of so many rows */

typedef struct layers {
    rast_mask whole;                    /* the body; [first, last) are whole bands */
    rast_mask visible[MODEL_MAX_LIMBS]; /* by limb; the same, with the columns of the whole body */
} layers;

typedef struct layers_limb { /* a limb's polygon in the grid, in the bodies of a block */
    uint32_t at[RAST_MAX_VERTICES][BLOCK], slope[RAST_MAX_VERTICES][BLOCK]; /* its edges as in rast_edge; */
    int32_t first[RAST_MAX_VERTICES][BLOCK], rows[RAST_MAX_VERTICES][BLOCK];
    int32_t top[BLOCK], end[BLOCK]; /* the bands that it meets; none behind the camera */
} layers_limb;

typedef struct layers_block {
    int32_t vertices[MODEL_MAX_LIMBS];
    int32_t count;                                                  /* limbs */
    int32_t drawn[BLOCK];                                           /* of them in front of the camera */
    int32_t first[BLOCK], last[BLOCK], column[BLOCK], width[BLOCK]; /* of the masks of the whole body */
    uint8_t order[BLOCK][MODEL_MAX_LIMBS]; /* from near to far; equal depths by index */
    _Alignas(GAIT_ALIGN) layers_limb limb[MODEL_MAX_LIMBS];
} layers_block;

/* Limb indices from near to far by depth[l * stride]; limbs behind the camera (depth 0) are left out.
 * Returns how many there are. */
int32_t layers_order(const float *depth, int32_t stride, int32_t limbs, int32_t *order);
#endif
