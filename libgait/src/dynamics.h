/* dynamics.h - temporal prior of Ormoneit et al. (2000), eqs. 5-9, as resolved in the design document. */
#ifndef GAIT_DYNAMICS_H
#define GAIT_DYNAMICS_H
#include "population.h"

/* Streams of random numbers: one per purpose, so that none depends on how many another took. */
enum { STREAM_START = 1, STREAM_MOVE = 2, STREAM_RESAMPLE = 3, STREAM_FORK = 4 };

typedef struct dynamics {
    const gait_tracker_config *cfg;
    body_rule rule;
    uint64_t seed;
} dynamics;

/* Particle i of the prior: independent normals about mean (gait_tracker_start). */
walker dynamics_draw(const dynamics *d, const gait_state *mean, const gait_state *sd, int32_t i);

/* One interval of dt seconds; age: seconds since start, frame: counter of the random numbers. */
walker dynamics_move(const dynamics *d, const walker *from, float dt, float age, uint32_t frame, int32_t i);
#endif
