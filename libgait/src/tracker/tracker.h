/* tracker.h - start a tracker and step it: resample, rejuvenate, predict, extract features, weight, estimate. */
#ifndef GAIT_TRACKER_TRACKER_H
#define GAIT_TRACKER_TRACKER_H
#include "tracker/tracker_state.h"

/* Draw the particles around a person's expected state; arguments as for gait_tracker_start(), already checked. */
void tracker_start(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime);

/* Process one frame, already checked. */
void tracker_step(gait_tracker *t, const gait_frame *frame, gait_estimate *out);

/* Move n states by dt seconds of the dynamics, with random numbers that no step draws. */
void tracker_predict(const gait_tracker *t, gait_state *s, int32_t n, float dt);
#endif
