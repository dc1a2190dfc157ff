/* The limbs of BLOCK bodies as polygons, one lane a body. */
#include "base/dispatch.h"
#include "raster/limb_polygon.h"

static limb_projection projection_of(const limb_geometry *g, const kin_body *body, int32_t lane,
                                     const gait_camera *cam, const view_map *map)
{
    const float (*const R)[BLOCK] = body->R[g->frame], (*const o)[BLOCK] = body->o[g->frame];
    return (limb_projection){.g = g,
                             .R = {R[0][lane], R[1][lane], R[2][lane], R[3][lane], R[4][lane], R[5][lane],
                                   R[6][lane], R[7][lane], R[8][lane]},
                             .o = {o[0][lane], o[1][lane], o[2][lane]},
                             .scale = body->scale[g->frame][lane],
                             .cam = cam,
                             .map = map};
}

static void store(const limb_polygon *q, int32_t vertices, int32_t lane, outline_lanes *restrict out)
{
    for (int32_t k = 0; k < vertices; k++) {
        out->x[k][lane] = q->x[k];
        out->y[k][lane] = q->y[k];
    }
    out->depth[lane] = q->depth;
    out->cos_tilt[lane] = q->cos_tilt;
}

void KERNEL(outline_project)(const limb_geometry *limbs, int32_t count, const kin_body *restrict body,
                             const gait_camera *cam, const view_map *map, outline_block *restrict out)
{
    gait_camera const projection = *cam;
    view_map const window = *map;
    for (int32_t l = 0; l < count; l++) {
        limb_geometry const g = limbs[l];
        if (g.shape == LIMB_ELLIPSOID)
            KERNEL_LANES
        for (int32_t i = 0; i < BLOCK; i++) {
            limb_projection const p = projection_of(&g, body, i, &projection, &window);
            limb_polygon q;
            ellipsoid_polygon(&p, &q);
            store(&q, 8, i, &out->limb[l]);
        }
        else KERNEL_LANES for (int32_t i = 0; i < BLOCK; i++)
        {
            limb_projection const p = projection_of(&g, body, i, &projection, &window);
            limb_polygon q;
            cone_polygon(&p, &q);
            store(&q, 4, i, &out->limb[l]);
        }
    }
}
