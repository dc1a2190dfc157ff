/* rejuvenation.h - moves particles after resampling so that they do not depend on one ancestor (kernel
 * shrinkage).
 *
 * After a second of resampling, all particles descend from a few ancestors, and would share their depth, stature and
 * posture. Therefore, after resampling, every state x becomes
 *
 * | x' = x + a (m - x) + sqrt(a (1 - a)) (j - k)
 *
 * with m, j and k particles drawn by weight, and a at most 1/2. The mean and the covariance of the particle set stay
 * as they were (shrinkage of Liu and West 2001; their kernel drawn as a difference of particles, ter Braak 2006). */
#ifndef GAIT_FILTER_REJUVENATION_H
#define GAIT_FILTER_REJUVENATION_H
#include "filter/dynamics.h"

typedef struct rejuvenation { /* parameters for one frame */
    int32_t fields;
    const float *row;      /* rows of every particle that can be an ancestor: rejuvenation_rows() */
    const int32_t *parent; /* n: drawn by weight */
    int32_t n, split;      /* from `split` on particles are another hypothesis, rejuvenated separately */
    /* Class of each particle's ancestor, NULL: the model has one class.  With several, particles begin .. n - 1, which
     * are of class motion_class, are rejuvenated together if their ancestors were of that class too. */
    const uint8_t *origin;
    int32_t begin;
    int32_t motion_class;
    uint64_t seed;
    uint32_t frame;      /* counter of the random numbers */
    float shrink, noise; /* a and sqrt(a (1 - a)); 0: no change */
} rejuvenation;

/* Set shrink and noise for an interval, seconds; time: rejuvenation_time, 0: never. */
void rejuvenation_set(rejuvenation *m, float seconds, float time);

/* Floats in a particle's row: its fields, padded with zeros. */
static inline int32_t rejuvenation_stride(int32_t fields)
{
    return (fields + 3) & ~3;
}

/* Write the rows of particles begin .. end - 1.  A particle drawn at random is then read from two cache lines rather
 * than from one per field. */
void rejuvenation_rows(const particle_set *from, int32_t begin, int32_t end, float *row);

/* Rejuvenate particles parent[first], parent[first + 1] ... into `out`; unused lanes repeat the last one. */
void rejuvenate_block(const rejuvenation *m, int32_t first, int32_t lanes, particle_block *out);
#endif
