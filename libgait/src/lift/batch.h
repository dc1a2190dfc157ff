/* batch.h - many segments with the same visibility and noise, by a gain that is computed once (orthographic view, known
 * heading: theta is linear in the observations). */
#ifndef GAIT_LIFT_BATCH_H
#define GAIT_LIFT_BATCH_H
#include "lift/segment_posterior.h"

typedef struct lift_gain {
    double *row;   /* F x J x 2 x ld: the gain; theta = sum of row (observation - base) */
    double *base;  /* F x J x 2: observations of the prior's mean */
    double *keep;  /* F x J: share of the residual that is due to the marker itself; negative: not observed */
    double *theta; /* n */
    lift_axes axes; /* of the prior */
    bool ready;
} lift_gain;

void lift_gain_layout(arena *a, const lift_table *t, lift_gain *g);
/* sd is F x J.  b receives a posterior whose covariance is valid.  false: numbers out of range. */
bool lift_gain_fix(const lift_table *t, lift_gain *g, segment_posterior *b, const double *sd);
/* One segment: uv F x J x 2 to mean F x J x 3. */
void lift_gain_apply(const lift_table *t, const lift_gain *g, const double *uv, double *mean);
#endif
