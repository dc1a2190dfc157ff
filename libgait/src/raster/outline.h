/* outline.h - limbs as convex polygons in one camera's working image. */
#ifndef GAIT_RASTER_OUTLINE_H
#define GAIT_RASTER_OUTLINE_H
#include "model/kinematics.h"
#include "raster/rast.h"
#include "image/view.h"

typedef struct limb_geometry { /* one limb in its frame, statures */
    float start[3], end[3];
    float lateral[3], sagittal[3]; /* unit vectors across the limb: along radii a, along radii b */
    float a0, b0, a1, b1;
    int32_t frame, shape; /* shape: LIMB_CONE or LIMB_ELLIPSOID */
} limb_geometry;

/* The limbs of the model with radii multiplied by girth; out has MODEL_MAX_LIMBS elements. */
void limb_geometry_init(const gait_model *m, float girth, limb_geometry *out);

/* One limb in the working image. Cones have 4 vertices: 0-1 and 3-2 are the two long sides. Ellipsoids have
 * 8. */
typedef struct limb_polygon {
    float x[RAST_MAX_VERTICES], y[RAST_MAX_VERTICES]; /* working pixels */
    float depth;    /* metres, of the middle of the limb; 0: behind the camera */
    float cos_tilt; /* cosine of the angle between limb and image plane */
} limb_polygon;

typedef struct outline_lanes { /* the same for BLOCK bodies */
    float x[RAST_MAX_VERTICES][BLOCK], y[RAST_MAX_VERTICES][BLOCK];
    float depth[BLOCK], cos_tilt[BLOCK];
} outline_lanes;

/* Here and in similar structs the limbs come last, because a tracker has memory only for the limbs of its
 * model. */
typedef struct outline_block {
    outline_lanes limb[MODEL_MAX_LIMBS];
} outline_block;

static inline int32_t outline_vertices(const limb_geometry *g)
{
    return g->shape == LIMB_ELLIPSOID ? 8 : 4;
}
#endif
