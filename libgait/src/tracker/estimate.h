/* estimate.h - what to report of the weighted particles (doc/method.md, filter). */
#ifndef GAIT_TRACKER_ESTIMATE_H
#define GAIT_TRACKER_ESTIMATE_H
#include "tracker/tracker.h"

/* Metres per second along the ground: stride length times stride rate. */
float estimate_speed(const gait_tracker *t, const particle_state *w);

typedef struct crowd { /* weighted particles, whose joints are in t->joint */
    particle_set particles;
    const int32_t *who; /* n: which of the people; NULL: all */
    int32_t n;
    const double *weight; /* n */
} crowd;

/* Means, deviations, dominant mode and joints; best is the heaviest of the crowd.  Returns the mean of the dominant
 * mode.  Writes t->mode and, unless the crowd is all people, t->ll, t->used and t->inner. */
particle_state estimate_crowd(const gait_tracker *t, const crowd *c, int32_t best, gait_estimate *out);

/* The same of the current particles. */
particle_state estimate_fill(const gait_tracker *t, int32_t best, gait_estimate *out);
#endif
