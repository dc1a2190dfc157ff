/* outline.h - limbs as convex polygons in one camera's working image. */
#ifndef GAIT_RASTER_OUTLINE_H
#define GAIT_RASTER_OUTLINE_H
#include "model/kinematics.h"
#include "raster/rast.h"
#include "image/view.h"

typedef struct limb_geometry { /* one body part in its frame, statures */
    float start[3], end[3];
    float lateral[3],
        sagittal[3]; /* unit vectors across the limb; radii a along the first, b along the second */
    float a0, b0, a1, b1;
    int32_t frame, shape; /* shape: LIMB_CONE or LIMB_ELLIPSOID */
} limb_geometry;

/* All limbs of the model with radii multiplied by girth; out holds MODEL_MAX_LIMBS. */
void limb_geometry_init(const gait_model *m, float girth, limb_geometry *out);

/* One limb in the working image.  Cones: vertices 0-1 and 3-2 are the two sides, 4 in all; ellipsoids: 8
 * around. */
typedef struct limb_polygon {
    float x[RAST_MAX_VERTICES], y[RAST_MAX_VERTICES]; /* working pixels */
    float depth;                                      /* metres, of the limb's middle; 0: behind the camera */
    float cos_tilt;                                   /* cosine of the angle between limb and image plane */
} limb_polygon;

typedef struct outline_lanes { /* the same in BLOCK bodies */
    float x[RAST_MAX_VERTICES][BLOCK], y[RAST_MAX_VERTICES][BLOCK];
    float depth[BLOCK], cos_tilt[BLOCK];
} outline_lanes;

/* Here and in what is made of it the limbs come last: a tracker has memory for those of its model only. */
typedef struct outline_block {
    outline_lanes limb[MODEL_MAX_LIMBS];
} outline_block;

static inline int32_t outline_vertices(const limb_geometry *g)
{
    return g->shape == LIMB_ELLIPSOID ? 8 : 4;
}
#endif
