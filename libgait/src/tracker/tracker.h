/* tracker.h - start a tracker and step it: resample, rejuvenate, predict, extract features, weight, estimate. */
#ifndef GAIT_TRACKER_TRACKER_H
#define GAIT_TRACKER_TRACKER_H
#include "gait_start.h"
#include "tracker/tracker_state.h"

/* Draw the particles from hypotheses of a person's state, from each in proportion to its probability; arguments as for
 * gait_tracker_start_hypotheses(), already checked.  sure: no proof of a person is required, as after
 * gait_tracker_start(). */
void tracker_start(gait_tracker *t, const gait_hypothesis *h, int32_t count, bool sure, int64_t utime);

/* Process one frame, already checked. */
void tracker_step(gait_tracker *t, const gait_frame *frame, gait_estimate *out);

/* Move n states by dt seconds of the dynamics, with random numbers that no step draws. */
void tracker_predict(const gait_tracker *t, gait_state *s, int32_t n, float dt);
#endif
