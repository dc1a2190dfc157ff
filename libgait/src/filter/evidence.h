/* evidence.h - the evidence of weighted particles, and tempering of their likelihoods before the weights are
 * updated. */
#ifndef GAIT_FILTER_EVIDENCE_H
#define GAIT_FILTER_EVIDENCE_H
#include "filter/pf.h"

/* Log of the mean of exp(loglik) under the weights, which need not sum to 1; -1e300 if no likelihood is
 * finite. A NaN counts as a likelihood of 0. */
double evidence_of(const pf *p, const float *loglik);

/* Raise the likelihoods to a power. */
void evidence_temper(float *loglik, int32_t n, float power);

/* Raise the likelihoods to the largest power 1, 1/2, 1/4 ... that leaves an effective sample size of this share of the
 * particles, so that a start from a broad prior does not follow a few particles that fit the first frame by chance
 * (annealing; Deutscher and Reid 2005). */
void evidence_anneal(const pf *p, float *loglik, double share);
#endif
