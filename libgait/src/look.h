/* look.h - what the cameras see of a frame where the walker should be. */
#ifndef GAIT_LOOK_H
#define GAIT_LOOK_H
#include "tracker.h"

/* Move each camera's region to the predicted walker and compute its features.  Returns how many cameras saw. */
int32_t look_frame(gait_tracker *t, const gait_frame *frame, const walker *predicted);
#endif
