/* rejuvenation.h - moves particles after resampling so that they do not depend on one ancestor (kernel
 * shrinkage).
 *
 * Most particles of a second ago have no descendants. A few are the ancestors of all, so all would have their
 * depth, stature and posture. Therefore every state becomes, after resampling,
 *
 * | x' = x + a (m - x) + sqrt(a (1 - a)) (j - k)
 *
 * with m, j and k particles drawn by weight. The mean and the covariance of the particle set stay as they
 * were (shrinkage of Liu and West 2001; their kernel drawn as a difference of particles, ter Braak 2006). */
#ifndef GAIT_FILTER_REJUVENATION_H
#define GAIT_FILTER_REJUVENATION_H
#include "filter/dynamics.h"

typedef struct rejuvenation { /* parameters for one frame */
    int32_t fields;
    const float *row;      /* rows of every particle that can be an ancestor: rejuvenation_rows() */
    const int32_t *parent; /* n: drawn by weight */
    int32_t n, split;      /* from `split` on particles are another hypothesis, rejuvenated separately */
    const uint8_t
        *origin; /* NULL: one class; otherwise the class of each particle's ancestor.  Then only particles */
    int32_t begin;        /* begin .. n - 1 are rejuvenated together, those whose ancestors were of */
    int32_t motion_class; /* this class, which is also theirs */
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

/* Rows of particles begin .. end - 1: a particle drawn at random is read from two cache lines, not from one
 * for each field. */
void rejuvenation_rows(const particle_set *from, int32_t begin, int32_t end, float *row);

/* Particles parent[first], parent[first + 1] ... after rejuvenation. The remaining lanes repeat the last
 * one. */
void rejuvenate_block(const rejuvenation *m, int32_t first, int32_t lanes, particle_block *out);
#endif
