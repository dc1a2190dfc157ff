/* toy_draw.h - outlines by the kernels of this CPU.
 *
 *   toy_project(limbs, count, &body, &cam, &map, &outline); */
#ifndef TOY_DRAW_H
#define TOY_DRAW_H
#include "kernels.h"
#include "outline.h"

static inline void toy_project(const limb_geometry *limbs, int32_t count, const kin_body *body,
                               const gait_camera *cam, const view_map *map, outline_block *out)
{
    kernels_choose(~0u)->outline_project(limbs, count, body, cam, map, out);
}

#endif
