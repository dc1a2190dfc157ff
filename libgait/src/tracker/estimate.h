/* estimate.h - the estimate that is reported of weighted particles. */
#ifndef GAIT_TRACKER_ESTIMATE_H
#define GAIT_TRACKER_ESTIMATE_H
#include "tracker/tracker_state.h"

#define DOMINANT_WEIGHT 0.7f /* weight of the dominant hypothesis from which its mean is a good estimate */

typedef struct weighted_particles {
    particle_set all;
    const int32_t *index; /* n: which of all; NULL: every one.  Their fields are gathered in t->lag.column */
    int32_t n;
    const double *weight; /* n */
    const strata *strata; /* of these n; NULL: one class */
} weighted_particles;

/* Means, standard deviations, dominant hypothesis and joints.  best: the heaviest particle, with several classes that of the
 * most probable one.  Returns the mean of the dominant hypothesis, whose particles t->dominant marks. */
particle_state estimate_weighted(const gait_tracker *t, const weighted_particles *p, int32_t best,
                                 gait_estimate *out);

/* The same for the current particles. */
particle_state estimate_particles(const gait_tracker *t, int32_t best, gait_estimate *out);
#endif
