/* render.h - draws the limbs of one body into an image of any size. */
#ifndef GAIT_RASTER_RENDER_H
#define GAIT_RASTER_RENDER_H
#include "raster/outline.h"

/* Errors are those of model_pose_state. */
gait_result render_limbs(const gait_model *m, const gait_camera *cam, const gait_state *s, uint8_t *ids,
                         int32_t stride);
#endif
