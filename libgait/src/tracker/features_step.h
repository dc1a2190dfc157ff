/* features_step.h - what the cameras see of a frame where the walker should be. */
#ifndef GAIT_TRACKER_FEATURES_STEP_H
#define GAIT_TRACKER_FEATURES_STEP_H
#include "tracker/tracker.h"

/* Move each camera's region to the predicted walker and compute its features.  Returns how many cameras saw. */
int32_t features_step(gait_tracker *t, const gait_frame *frame, const particle_state *predicted);
#endif
