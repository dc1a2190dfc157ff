/* dynamics.h - motion model: the temporal prior of Ormoneit et al. (2000), eqs. 5-9, with the
 * details of doc/method.md. */
#ifndef GAIT_FILTER_DYNAMICS_H
#define GAIT_FILTER_DYNAMICS_H
#include "base/fmath.h"
#include "filter/particles.h"

/* Streams of random numbers, one per purpose, so that none depends on how many numbers another has used. */
enum {
    STREAM_START = 1,
    STREAM_MOVE = 2,
    STREAM_RESAMPLE = 3,
    STREAM_SPLIT = 4,
    STREAM_REJUVENATION = 5,
    STREAM_CLASS = 6
};

typedef struct dynamics {
    const gait_tracker_config *cfg;
    state_layout rule;
    uint64_t seed;
    float stature_sd_ratio; /* standard deviation of stature at the start, relative to it */
} dynamics;

enum { DYNAMICS_CORRELATED = 6 }; /* phase, stride_hz, stature, heading, pelvis x and y */

/* Root L of a correlation matrix C, L L' = C. */
void dynamics_root(const float C[DYNAMICS_CORRELATED][DYNAMICS_CORRELATED],
                   float L[DYNAMICS_CORRELATED][DYNAMICS_CORRELATED]);
/* Particle i of the prior: normal distributions about mean (gait_tracker_start), correlated by a root, or independent if
 * that is NULL. */
particle_state dynamics_draw(const dynamics *d, const gait_state *mean, const gait_state *sd,
                             const float (*root)[DYNAMICS_CORRELATED], int32_t i);

typedef struct relaxing { /* x -> keep x + noise n over an interval, n standard normal */
    float keep, noise;
} relaxing;

typedef struct dynamics_step { /* constants of one interval; noise: standard deviations over the interval */
    const gait_model *model;
    uint64_t seed;
    uint32_t frame; /* counter of the random numbers */
    bool plain_root;
    int32_t fields, components; /* how many */
    int32_t proportion, offset; /* first field of each */
    float dt;                   /* seconds, negative if frames come in reverse order */
    float phase_dt;             /* seconds by which the cycle advances: -dt backwards, 0 standing still */
    float mean_rate;            /* strides per second */
    float travel;               /* share of a stride that the person travels */
    float phase_noise, forward_noise, lateral_noise, heading_noise, stature_noise;
    float turn_beyond; /* squared normal beyond which a particle draws a new turn rate */
    float turn_sd;     /* radians per second */
    relaxing rate, level, tilt, score, shape;
    relaxing posture[GAIT_MAX_ANGLES]; /* in the order of the fields */
} dynamics_step;

/* An interval of dt seconds; age: seconds since start. */
dynamics_step dynamics_step_init(const dynamics *d, float dt, float age, uint32_t frame);

/* Reflect a stride rate at the limits of its range. */
static inline float dynamics_reflect_rate(float x)
{
    float const lo = 1.0f / 2.1f, hi = 1.0f / 0.4f; /* stride times of 0.4 to 2.1 s */
    float const y = m_select(m_less(x, lo), 2.0f * lo - x, m_select(m_less(hi, x), 2.0f * hi - x, x));
    return f_clamp(y, lo, hi);
}

/* Kernel dynamics_move: particles first .. first + BLOCK - 1 over one interval. */
#endif
