/* layers.h - one body's limbs drawn into the grid with depth order: what of each limb can be seen. */
#ifndef GAIT_RASTER_LAYERS_H
#define GAIT_RASTER_LAYERS_H
#include "raster/outline.h"

enum {
    LAYERS_BAND = 8, /* bodies, and where limbs begin, are at multiples of so many rows */
    LAYERS_LINES = 4 /* most lines that bound a polygon on one side: an octagon's */
};

typedef struct layers {
    grid_mask whole;                    /* the body; [first, last) are whole bands */
    grid_mask visible[MODEL_MAX_LIMBS]; /* by limb, first as the whole body's; with its columns */
} layers;

/* A convex polygon in the grid, in the bodies of a block: in rows top <= y < end what lies right of all of its left
 * lines and left of all of its right ones, the lines going on beyond the corners.  Columns, from the body's first on,
 * are at + slope y; those of right lines are negative, so that of either side the greatest counts. */
typedef struct layers_limb {
    float line[BLOCK][4 * LAYERS_LINES]; /* at left, right; slope left, right; of each line */
    int32_t top[BLOCK], end[BLOCK];      /* none behind the camera */
} layers_limb;

typedef struct layers_block {
    int32_t lines[MODEL_MAX_LIMBS]; /* on either side: 3 of a cone, LAYERS_LINES of an ellipsoid */
    int32_t count;                  /* limbs */
    int32_t first[BLOCK], last[BLOCK], column[BLOCK], width[BLOCK]; /* of the masks of the whole body */
    uint8_t order[BLOCK][MODEL_MAX_LIMBS]; /* near to far, behind the camera last; equal depths by index */
    _Alignas(GAIT_ALIGN) layers_limb limb[MODEL_MAX_LIMBS];
} layers_block;

/* Limb indices from near to far by depth[l * stride]; limbs behind the camera (depth 0) are left out.
 * Returns how many there are. */
int32_t layers_order(const float *depth, int32_t stride, int32_t limbs, int32_t *order);
#endif
