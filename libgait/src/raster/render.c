#include "raster/render.h"
#include "raster/layers.h"
#include "raster/limb_polygon.h"
#include <string.h>

/* Paint one polygon, in bands of GRID_SIZE rows. */
static void paint(const limb_polygon *p, int32_t n, uint8_t id, uint8_t *ids, const gait_camera *cam,
                  int32_t stride)
{
    for (int32_t top = 0; top < cam->height; top += GRID_SIZE) {
        rast_spans spans;
        rast_convex(p->x, p->y, n, top, cam->width, &spans);
        for (int32_t row = spans.first; row < i_min(spans.last, cam->height); row++) {
            int32_t const begin = spans.begin[row - top], end = spans.end[row - top];
            if (begin < end)
                memset(ids + (size_t)row * (size_t)stride + begin, id, (size_t)(end - begin));
        }
    }
}

gait_result render_limbs(const gait_model *m, const gait_camera *cam, const gait_state *s, uint8_t *ids,
                         int32_t stride)
{
    view_map const whole = {.scale = 1.0f};
    limb_geometry limbs[MODEL_MAX_LIMBS];
    limb_polygon poly[MODEL_MAX_LIMBS];
    float depth[MODEL_MAX_LIMBS];
    int32_t order[MODEL_MAX_LIMBS];
    kin_frames body;
    gait_result const status = model_place_state(m, s, &body);
    if (status != GAIT_OK)
        return status;
    limb_geometry_init(m, 1.0f, limbs);
    for (int32_t l = 0; l < m->limbs; l++) {
        int32_t const f = limbs[l].frame;
        outline_limb(&limbs[l], body.R + 9 * f, body.o + 3 * f, body.scale[f], cam, &whole, &poly[l]);
        depth[l] = poly[l].depth;
    }
    for (int32_t row = 0; row < cam->height; row++)
        memset(ids + (size_t)row * (size_t)stride, 0, (size_t)cam->width);
    /* From far to near, so that nearer limbs are painted over farther ones. */
    for (int32_t k = layers_order(depth, 1, m->limbs, order) - 1; k >= 0; k--)
        paint(&poly[order[k]], outline_vertices(&limbs[order[k]]), (uint8_t)(order[k] + 1), ids, cam, stride);
    return GAIT_OK;
}
