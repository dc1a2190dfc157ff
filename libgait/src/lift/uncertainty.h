/* lift_uncertainty.h - what the observations alone say, and what they leave open. */
#ifndef GAIT_LIFT_UNCERTAINTY_H
#define GAIT_LIFT_UNCERTAINTY_H
#include "lift/fit.h"

/* Degrees of freedom of lift_scale, chosen on sequences that are not reported (make eval-lift, lift_modes). */
#define LIFT_FREEDOM 4.0

/* theta of minimum norm over unit displacements that fits best whatever the prior says, in spare->theta;
 * the heading is b's. spare->A and U are lost. */
void lift_likelihood_only(const lift_table *t, const lift_window *w, const segment_posterior *b,
                          segment_posterior *spare);
/* The `count` most uncertain displacements, one deviation long (count x F x J x 3, metres; entry of largest
 * magnitude positive), and their deviations over all markers and frames. spare is lost. */
void lift_uncertain(const lift_table *t, const segment_posterior *b, segment_posterior *spare, int32_t count,
                    double *mode, double *sd);
/* Q, n x n. */
void lift_covariance(const lift_table *t, const segment_posterior *b, segment_posterior *spare, double *Q);
/* How much further from its mean than the prior expects the motion is.  With s^2 ~ LIFT_FREEDOM / chi^2(LIFT_FREEDOM)
 * a priori and modes ~ N(0, s^2), but noise and residual as they are: the likeliest s^2. spare is lost. */
double lift_scale(const lift_table *t, const segment_posterior *b, segment_posterior *spare);
#endif
