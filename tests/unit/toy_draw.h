/* toy_draw.h - outlines and layers by the kernels of this CPU.
 *
 *   toy_project(limbs, count, &body, &cam, &map, &outline);
 *   toy_draw(&outline, limbs, count, lane, &layers); */
#ifndef TOY_DRAW_H
#define TOY_DRAW_H
#include "api/kernels.h"
#include "raster/layers.h"

static inline void toy_project(const limb_geometry *limbs, int32_t count, const kin_body *body,
                               const gait_camera *cam, const view_map *map, outline_block *out)
{
    kernels_choose(~0u)->outline_project(limbs, count, body, cam, map, out);
}

static inline void toy_draw(const outline_block *outline, const limb_geometry *limbs, int32_t count,
                            int32_t lane, layers *out)
{
    static layers_block block;
    kernels_choose(~0u)->layers_prepare(outline, limbs, count, &block);
    kernels_choose(~0u)->layers_draw(&block, lane, out);
}
#endif
