/* toy_crowd.h - people as particles: the filter's core with the library's own motion (dynamics.h), for
 * tests with likelihoods of their own.
 *
 *   dynamics const d = quiet(GAIT_MODE_DEFAULT, seed);   then set the noises in cfg
 *   crowd c = crowd_new(&d, n);                          n a multiple of BLOCK; fill c.now[i]
 *   crowd_predict(&c, dt, age, frame);                   resamples first if fewer than half are effective
 *   crowd_update(&c, ll); */
#ifndef TOY_CROWD_H
#define TOY_CROWD_H
#include "toy_filter.h"
#include "toy_prior.h"

typedef struct crowd {
    dynamics d;
    pf p;
    double ess;
    particle_state *now, *next;
} crowd;

static inline crowd crowd_new(const dynamics *d, int32_t n)
{
    static particle_state particles[2][TOY_MOST];
    return (crowd){.d = *d, .p = toy_filter(n), .ess = n, .now = particles[0], .next = particles[1]};
}

static inline void crowd_predict(crowd *c, float dt, float age, uint32_t frame)
{
    particle_state *const old = c->now;
    pf_keep(&c->p);
    if (c->ess < 0.5 * c->p.n)
        pf_resample_systematic(&c->p, toy_bits(c->d.seed, frame));
    for (int32_t i = 0; i < c->p.n; i += BLOCK) {
        for (int32_t lane = 0; lane < BLOCK; lane++)
            c->next[i + lane] = old[c->p.parent[i + lane]];
        move_block(&c->d, c->next + i, dt, age, frame, i);
    }
    c->now = c->next;
    c->next = old;
}

static inline void crowd_update(crowd *c, const float *ll)
{
    c->ess = pf_update(&c->p, ll).ess;
}
#endif
