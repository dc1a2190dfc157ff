/* layers.h - the limbs of one body drawn into the grid in depth order: which cells of each limb are visible. */
#ifndef GAIT_RASTER_LAYERS_H
#define GAIT_RASTER_LAYERS_H
#include "raster/outline.h"

enum {
    LAYERS_BAND = 8, /* bodies and limbs begin at multiples of this many rows */
    LAYERS_LINES = 4 /* most lines that bound a polygon on one side: those of an octagon */
};

typedef struct layers {
    grid_mask whole;                    /* the whole body; rows [first, last) are whole bands */
    grid_mask visible[MODEL_MAX_LIMBS]; /* by limb, with the columns of the whole body */
} layers;

/* A convex polygon in the grid, for each body of a block: the cells in rows top <= y < end that are right of
 * all its left lines and left of all its right lines. Lines continue beyond the corners. The column of a
 * line, relative to the first column of the body, is at + slope y; right lines are stored with opposite signs,
 * so that on both sides the greatest value decides. */
typedef struct layers_limb {
    float line[BLOCK][4 * LAYERS_LINES]; /* (at left, at right, slope left, slope right) of each line */
    int32_t lines[BLOCK];                /* the first 2 decide on each side, or more */
    int32_t top[BLOCK], end[BLOCK];      /* no rows if behind the camera */
} layers_limb;

typedef struct layers_block {
    int32_t count;                                                  /* limbs */
    int32_t first[BLOCK], last[BLOCK], column[BLOCK], width[BLOCK]; /* of the mask of the whole body */
    uint8_t order[BLOCK][MODEL_MAX_LIMBS]; /* near to far, then those behind the camera */
    _Alignas(GAIT_ALIGN) layers_limb limb[MODEL_MAX_LIMBS];
} layers_block;

/* Limb indices from near to far by depth[l * stride], without limbs behind the camera (depth 0). Returns
 * their number. */
int32_t layers_order(const float *depth, int32_t stride, int32_t limbs, int32_t *order);
#endif
