/* toy_filter.h - a particle filter's weights in static memory, a test of ranks against the uniform distribution, and
 * FIGURE() for what a check measured, which FIGURES=1 build/release/unit/test_pf_... prints. */
#ifndef TOY_FILTER_H
#define TOY_FILTER_H
#include "filter/pf.h"

#include "base/rng.h"

#include "check.h"

#include <stdlib.h>

#define FIGURE(...) (getenv("FIGURES") ? printf(__VA_ARGS__) : 0)

enum { TOY_MOST = 10240 }; /* particles */

/* Uniform weights, every particle its own ancestor, with capacity for more; every call uses the same memory. */
static inline pf toy_filter(int32_t n)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[TOY_MOST * 28 + 4 * GAIT_ALIGN];
    arena a = {.base = memory, .cap = sizeof memory};
    pf p = pf_layout(&a, TOY_MOST);
    CHECK(!a.overflow);
    p.n = n;
    pf_uniform(&p);
    pf_keep(&p);
    return p;
}

/* 32 random bits, such as the common offset of a systematic resampling. */
static inline uint32_t toy_bits(uint64_t seed, uint32_t index)
{
    uint32_t r[4];
    rng_bits(seed, 6, index, 0, 0, r);
    return r[0];
}

static inline float toy_uniform(uint64_t seed, uint32_t index, uint32_t draw)
{
    float u[4];
    rng_uniform4(seed, 0, 0, index, draw, u);
    return u[0];
}

/* ---- ranks ---- */
enum { RANKS = 20 }; /* possible ranks of a truth among RANKS - 1 draws */

/* Chi-square with 19 degrees of freedom exceeds this with probability 0.01. */
static const double RANKS_LIMIT = 36.19;

/* Rank of a truth among the values of RANKS - 1 independent draws. */
static inline int ranks_of(const int32_t draw[RANKS - 1], const double *value, double truth)
{
    int rank = 0;
    for (int k = 0; k < RANKS - 1; k++)
        rank += value[draw[k]] < truth;
    return rank;
}

/* Chi-square of counts of ranks against a uniform distribution. */
static inline double ranks_chi2(const int32_t count[RANKS])
{
    double total = 0.0, sum = 0.0;
    for (int k = 0; k < RANKS; k++)
        total += count[k];
    for (int k = 0; k < RANKS; k++)
        sum += (count[k] - total / RANKS) * (count[k] - total / RANKS) / (total / RANKS);
    return sum;
}
#endif
