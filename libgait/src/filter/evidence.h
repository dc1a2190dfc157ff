/* evidence.h - what likelihoods say of weighted particles before the weights take them up. */
#ifndef GAIT_FILTER_EVIDENCE_H
#define GAIT_FILTER_EVIDENCE_H
#include "filter/pf.h"

/* Log of the mean of exp(loglik) under the weights, which need not sum to 1; -1e300 if there is none.  A NaN counts as
 * impossible. */
double evidence_of(const pf *p, const float *loglik);

/* Likelihoods to a power. */
void evidence_temper(float *loglik, int32_t n, float power);

/* Raise the likelihoods to the largest power 1, 1/2, 1/4 ... that leaves enough particles: a start from a broad prior
 * must not follow the first frame's luckiest few (annealing; Deutscher and Reid 2005). */
void evidence_anneal(const pf *p, float *loglik);
#endif
