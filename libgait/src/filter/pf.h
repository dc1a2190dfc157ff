/* pf.h - particle weights and resampling, independent of what a particle is. */
#ifndef GAIT_FILTER_PF_H
#define GAIT_FILTER_PF_H
#include "base/arena.h"

typedef struct pf {
    int32_t n;
    double *log_weight;   /* n, normalised: sum of exp is 1 */
    double *weight;       /* n */
    int32_t *parent;      /* n: ancestor indices of the last resampling, ascending if systematic */
    uint64_t *cumulative; /* n: running sum of integer weights */
} pf;

typedef struct pf_summary {
    double log_evidence; /* log sum w exp(loglik): p(observation | past) */
    double ess;          /* effective sample size, 1 / sum w^2 */
    int32_t best;        /* first particle of the largest weight */
    bool degenerate;     /* no particle had a finite likelihood: the weights did not change */
} pf_summary;

pf pf_layout(arena *a, int32_t n);
void pf_uniform(pf *p);

/* Multiply the weights by exp(loglik) and normalise. A NaN counts as a likelihood of 0. */
pf_summary pf_update(pf *p, const float *loglik);

double pf_ess(const pf *p);

/* First particle of the largest weight. */
int32_t pf_heaviest(const pf *p);

/* `count` ancestor indices of n weights, not all 0, by systematic resampling; cumulative: scratch of n. */
void pf_draw(const double *weight, int32_t n, uint64_t *cumulative, int32_t count, uint32_t u,
             int32_t *parent);

/* Ancestor indices by systematic resampling: |children - n w| < 1. u is the common offset, in 2^-32 of a step. */
void pf_resample_systematic(pf *p, uint32_t u);

/* The same for another number of particles, which becomes p->n; the arrays must have the capacity. */
void pf_resize(pf *p, int32_t count, uint32_t u);

/* n independent draws (Ormoneit et al. 2000, 4.4). */
void pf_resample_multinomial(pf *p, uint64_t seed, uint32_t stream, uint32_t frame);

/* Replace each particle's part of an array, of `bytes` bytes, by that of its ancestor, in place. before:
 * number of particles in the ancestors' generation. Overwrites the cumulative weights. */
void pf_inherit(pf *p, int32_t before, void *array, size_t bytes);

/* Every particle is its own ancestor. */
void pf_keep(pf *p);
#endif
