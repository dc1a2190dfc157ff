/* uncertainty.h - the fit without a prior, and what the observations leave uncertain. */
#ifndef GAIT_LIFT_UNCERTAINTY_H
#define GAIT_LIFT_UNCERTAINTY_H
#include "lift/fit.h"

/* Degrees of freedom of lift_scale, chosen on sequences that are not reported (make eval-lift, lift_modes). */
#define LIFT_FREEDOM 4.0

/* Least-squares fit without the prior: theta of minimum norm over unit displacements, in spare->theta; the heading is
 * b's.  spare->A and U are overwritten. */
void lift_least_squares(const lift_table *t, const lift_window *w, const segment_posterior *b,
                        segment_posterior *spare);
/* The `count` most uncertain displacements, one standard deviation long (count x F x J x 3, metres; entry of largest
 * magnitude positive), and their standard deviations over all markers and frames. spare is overwritten. */
void lift_uncertain(const lift_table *t, const segment_posterior *b, segment_posterior *spare, int32_t count,
                    double *mode, double *sd);
/* Covariance of theta, n x n. */
void lift_covariance(const lift_table *t, const segment_posterior *b, segment_posterior *spare, double *Q);
/* How much further the motion is from the prior's mean than the prior expects: the most probable s, for modes ~ N(0, s^2),
 * s^2 ~ LIFT_FREEDOM / chi^2(LIFT_FREEDOM) a priori, and unchanged noise and residual.  spare is overwritten. */
double lift_scale(const lift_table *t, const segment_posterior *b, segment_posterior *spare);
#endif
