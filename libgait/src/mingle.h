/* mingle.h - particles drawn anew around themselves, so that what they are does not hang on descent alone.
 *
 * Most particles of a second ago have no descendants: a few are the ancestors of all, and from them comes one depth, one
 * stature, one posture.  So after resampling every state becomes
 *
 *   x' = x + a (m - x) + sqrt(a (1 - a)) (j - k)
 *
 * with m, j and k particles drawn by weight.  Mean and covariance of all remain as they were (shrinkage of Liu and West
 * 2001; their kernel drawn as a difference of particles, ter Braak 2006). */
#ifndef GAIT_MINGLE_H
#define GAIT_MINGLE_H
#include "dynamics.h"

typedef struct mingling { /* of one frame, after resampling */
    const population *from;
    const int32_t *parent; /* n: drawn by weight */
    int32_t n;
    uint64_t seed;
    uint32_t frame;     /* counter of the random numbers */
    float pull, spread; /* a and sqrt(a (1 - a)); 0: nothing changes */
} mingling;

/* Set pull and spread for so many seconds since the last; time: seconds in which particles forget, 0: never. */
void mingling_set(mingling *m, float seconds, float time);

/* Change the lanes of w, which hold particles parent[first], parent[first + 1] ... */
void mingle_block(const mingling *m, int32_t first, int32_t lanes, walker_block *w);
#endif
