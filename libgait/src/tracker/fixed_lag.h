/* fixed_lag.h - fixed-lag smoothing: the estimate of an earlier frame given all frames since.
 *
 * The ancestors of the current particles, with the weights of their descendants (Kitagawa 1996, section 4). */
#ifndef GAIT_TRACKER_FIXED_LAG_H
#define GAIT_TRACKER_FIXED_LAG_H
#include "tracker/tracker_state.h"

/* Record the ancestors of the current generation, and what its estimate reports. */
void fixed_lag_record(gait_tracker *t, const gait_estimate *e);

/* Steps that fixed_lag_estimate() can go back now; -1: none. */
int32_t fixed_lag_reach(const gait_tracker *t);

/* Estimate of the frame `back` steps ago, at most fixed_lag_reach(). */
void fixed_lag_estimate(gait_tracker *t, int32_t back, gait_estimate *out);
#endif
