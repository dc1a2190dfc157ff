/* features_step.h - feature extraction: each camera's region of interest follows the person. */
#ifndef GAIT_TRACKER_FEATURES_STEP_H
#define GAIT_TRACKER_FEATURES_STEP_H
#include "tracker/tracker_state.h"

/* Set each camera to its pose in this frame, move its region to the predicted particle and compute its features.  Returns
 * the number of cameras that have an image. */
int32_t features_step(gait_tracker *t, const gait_frame *frame, const particle_state *predicted);
#endif
