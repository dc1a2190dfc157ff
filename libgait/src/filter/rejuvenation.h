/* rejuvenation.h - particles drawn anew around themselves, so that what they are does not hang on descent alone.
 *
 * Most particles of a second ago have no descendants: a few are the ancestors of all, and from them comes one depth, one
 * stature, one posture.  So after resampling every state becomes
 *
 *   x' = x + a (m - x) + sqrt(a (1 - a)) (j - k)
 *
 * with m, j and k particles drawn by weight.  Mean and covariance of all remain as they were (shrinkage of Liu and West
 * 2001; their kernel drawn as a difference of particles, ter Braak 2006). */
#ifndef GAIT_FILTER_REJUVENATION_H
#define GAIT_FILTER_REJUVENATION_H
#include "filter/dynamics.h"

typedef struct rejuvenation { /* of one frame, after resampling */
    int32_t fields;
    const float *row;      /* of every particle that can be a parent: rejuvenation_rows() */
    const int32_t *parent; /* n: drawn by weight */
    int32_t n, split;      /* particles from `split` on are another mode, which mingles by itself */
    uint64_t seed;
    uint32_t frame;      /* counter of the random numbers */
    float shrink, noise; /* a and sqrt(a (1 - a)); 0: nothing changes */
} rejuvenation;

/* Set shrink and noise for so many seconds since the last; time: seconds in which particles forget, 0: never. */
void rejuvenation_set(rejuvenation *m, float seconds, float time);

/* Floats of a particle's row: its fields and zeros. */
static inline int32_t rejuvenation_stride(int32_t fields)
{
    return (fields + 3) & ~3;
}

/* Rows of particles begin .. end - 1: one drawn at random is in two lines of the cache, and not in one for each field. */
void rejuvenation_rows(const particle_set *from, int32_t begin, int32_t end, float *row);

/* Particles parent[first], parent[first + 1] ... after rejuvenation; lanes beyond repeat the last. */
void rejuvenate_block(const rejuvenation *m, int32_t first, int32_t lanes, particle_block *out);
#endif
