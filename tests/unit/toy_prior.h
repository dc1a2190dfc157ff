/* toy_prior.h - dynamics without noise, to which tests add theirs, and a comparison of sample moments with true ones. */
#ifndef TOY_PRIOR_H
#define TOY_PRIOR_H
#include "filter/dynamics.h"
#include "api/kernels.h"
#include "toy_model.h"

#include "check.h"

enum { DRAWS = 8000, OFFSET_ANGLE = TOY_TORSO };

static gait_tracker_config cfg;

/* Default mode, two components and one posture offset, no noise at all. */
static inline dynamics quiet(int32_t mode, uint64_t seed)
{
    gait_tracker_default(&cfg, (gait_mode)mode);
    cfg.components = 2;
    cfg.offset_angles = 1u << OFFSET_ANGLE;
    cfg.proportions = mode == GAIT_MODE_PAPER ? 0 : -1;
    cfg.phase_noise = cfg.rate_noise = 0.0f;
    cfg.stature_noise = cfg.stature_noise_start = 0.0f;
    cfg.forward_noise = cfg.lateral_noise = cfg.vertical_noise = 0.0f;
    cfg.heading_noise = cfg.tilt_noise = cfg.coef_noise = cfg.offset_noise = cfg.proportion_noise = 0.0f;
    cfg.turn_time = 0.0f;
    cfg.settle_time = 1.0f;
    cfg.rate_time = 5.0f;
    cfg.tilt_time = 1.1f;
    cfg.coef_time = 4.5f;
    return (dynamics){.cfg = &cfg,
                      .rule = state_layout_init(toy_model(), &cfg, kernels_choose(~0u)),
                      .seed = seed,
                      .stature_sd_ratio = 0.05f};
}

/* Move particles first .. first + BLOCK - 1 by one interval of dt seconds. */
static inline void move_block(const dynamics *d, particle_state w[BLOCK], float dt, float age, uint32_t frame,
                              int32_t first)
{
    static particle_block from, to;
    dynamics_step const s = dynamics_step_init(d, dt, age, frame);
    for (int32_t f = 0; f < s.fields; f++)
        for (int32_t lane = 0; lane < BLOCK; lane++)
            from.f[f][lane] = w[lane].f[f];
    d->rule.run->dynamics_move(&s, first, &from, &to);
    for (int32_t f = 0; f < s.fields; f++)
        for (int32_t lane = 0; lane < BLOCK; lane++)
            w[lane].f[f] = to.f[f][lane];
}

/* Move particle i alone. */
static inline particle_state move_one(const dynamics *d, const particle_state *from, float dt, float age,
                                      uint32_t frame, int32_t i)
{
    particle_state block[BLOCK] = {{{0}}};
    block[i % BLOCK] = *from;
    move_block(d, block, dt, age, frame, i - i % BLOCK);
    return block[i % BLOCK];
}

typedef struct moments {
    double mean, var;
} moments;

static inline moments moments_of(const double *v, int n)
{
    moments m = {0.0, 0.0};
    for (int i = 0; i < n; i++)
        m.mean += v[i] / n;
    for (int i = 0; i < n; i++)
        m.var += (v[i] - m.mean) * (v[i] - m.mean) / n;
    return m;
}

/* Check that sample moments are within 4.5 standard errors of the true ones, and a little more for rounding. */
static inline void check_moments(moments have, double mean, double sd, int n)
{
    CHECK_NEAR(have.mean, mean, 4.5 * sd / sqrt(n) + 1e-5);
    CHECK_NEAR(have.var, sd * sd, 4.5 * sd * sd * sqrt(2.0 / n) + 1e-9);
}
#endif
