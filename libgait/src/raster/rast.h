/* rast.h - scan conversion of convex polygons to exact row spans of the grid.
 *
 * Coverage is decided in integers (vertices at 1/256 of a pixel). A pixel belongs to a polygon if its centre
 * does, left and top edges included, so that two polygons with a common edge never cover a pixel twice. */
#ifndef GAIT_RASTER_RAST_H
#define GAIT_RASTER_RAST_H
#include "base/grid_mask.h"

enum {
    RAST_MAX_VERTICES = 8,
    RAST_LIMIT = GAIT_MAX_PIXELS /* coordinates are clamped to +- this many pixels */
};

/* Rows first <= y < last; row y covers begin[y - top] <= x < end[y - top], or nothing if begin >= end. */
typedef struct rast_spans {
    int32_t first, last;
    int16_t begin[GRID_SIZE], end[GRID_SIZE];
} rast_spans;

/* Spans of a convex polygon of n vertices in a window of GRID_SIZE rows from top and columns [0, width). */
void rast_convex(const float *x, const float *y, int32_t n, int32_t top, int32_t width, rast_spans *out);

#endif
