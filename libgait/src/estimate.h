/* estimate.h - what to report of the weighted particles (spec 1.9). */
#ifndef GAIT_ESTIMATE_H
#define GAIT_ESTIMATE_H
#include "tracker.h"

/* Weighted mean of the fields that place the region of interest: track, level and stature. */
walker estimate_place(const population *p, const double *weight);

/* Metres per second along the ground: stride length times stride rate. */
float estimate_speed(const gait_tracker *t, const walker *w);

/* Means, deviations, dominant mode and joints; best is the heaviest particle.  Returns the mean of the
 * dominant mode. */
walker estimate_fill(const gait_tracker *t, int32_t best, gait_estimate *out);
#endif
