#include "filter/dynamics.h"
#include "base/fmath.h"
#include "base/rng.h"

/* People whose class of motion changes also change their pace, for longer and further than people who only walk. */
static const float SEVERAL_RATE_TIME = 10.0f; /* times the time in which the rate relaxes */

enum { NORMALS = 4 * ((F_MAX + 3) / 4) };

static void normals(const dynamics *d, uint32_t stream, uint32_t frame, int32_t i, int32_t count, float *out)
{
    for (int32_t k = 0; k < count; k += 4)
        rng_normal4(d->seed, stream, frame, (uint32_t)i, (uint32_t)(k / 4), out + k);
}

void dynamics_root(const float C[DYNAMICS_CORRELATED][DYNAMICS_CORRELATED],
                   float L[DYNAMICS_CORRELATED][DYNAMICS_CORRELATED])
{
    for (int32_t i = 0; i < DYNAMICS_CORRELATED; i++)
        for (int32_t k = 0; k <= i; k++) {
            float sum = i == k ? 1.0f : C[i][k];
            for (int32_t j = 0; j < k; j++)
                sum -= L[i][j] * L[k][j];
            L[i][k] = i == k ? __builtin_sqrtf(f_max(sum, 1e-6f)) : sum / L[k][k];
        }
}

/* Correlate independent normals, in place. */
static void correlate(const float (*root)[DYNAMICS_CORRELATED], float *n)
{
    static const uint8_t of[DYNAMICS_CORRELATED] = {0, 2, 3, 1, 6, 7};
    for (int32_t i = DYNAMICS_CORRELATED - 1; i >= 0; i--) {
        float sum = 0.0f;
        for (int32_t k = 0; k <= i; k++)
            sum += root[i][k] * n[of[k]];
        n[of[i]] = sum;
    }
}

particle_state dynamics_draw(const dynamics *d, const gait_state *mean, const gait_state *sd,
                             const float (*root)[DYNAMICS_CORRELATED], int32_t i)
{
    float const level_sd = 0.03f; /* metres: uncertainty of the ground level about z = 0 */
    int32_t const q = d->rule.components;
    float n[NORMALS], u[4];
    gait_state s = *mean;
    normals(d, STREAM_START, 0, i, state_layout_fields(&d->rule), n);
    if (root)
        correlate(root, n);
    rng_uniform4(d->seed, STREAM_START, 1, (uint32_t)i, 0, u);
    s.phase = sd->phase >= 0.5f ? u[0] : m_wrap1(mean->phase + sd->phase * n[0]);
    if (d->rule.model->direction == 0)
        s.phase = 0.0f;
    s.heading = sd->heading >= PI_F ? TWO_PI_F * u[1] : mean->heading + sd->heading * n[1];
    s.stride_hz = dynamics_reflect_rate(mean->stride_hz + sd->stride_hz * n[2]);
    s.stature = f_max(mean->stature + sd->stature * n[3], LEAST_STATURE);
    s.pitch += sd->pitch * n[4];
    s.roll += sd->roll * n[5];
    s.pelvis[0] += sd->pelvis[0] * n[6];
    s.pelvis[1] += sd->pelvis[1] * n[7];
    float const turn_sd =
        f_min(1.41421356f * sd->turn_rate, d->cfg->turn_sd); /* of those who turn, which half do not */
    s.turn_rate += u[2] < 0.5f ? 0.0f : turn_sd * n[F_TURN];
    for (int32_t k = 0; k < q; k++)
        s.coef[k] += d->cfg->coef_start * sd->coef[k] * n[F_COEF + k];
    for (int32_t k = 0; k < d->rule.proportions; k++)
        s.proportion[k] += sd->proportion[k] * n[state_layout_proportion(&d->rule) + k];
    for (int32_t k = 0; k < d->rule.offsets; k++) {
        int32_t const a = d->rule.angle[k];
        s.offset[a] += sd->offset[a] * n[state_layout_offset(&d->rule) + k];
    }
    particle_state w = particle_from_state(&d->rule, &s);
    /* The given height of the pelvis and the ground at z = 0 are two measurements of one level (paper mode:
     * only the first is used). */
    float const var = sd->pelvis[2] * sd->pelvis[2];
    float const trust = d->rule.plain_root ? 1.0f : level_sd * level_sd / (level_sd * level_sd + var);
    w.f[F_Z] = trust * w.f[F_Z] + __builtin_sqrtf(trust) * sd->pelvis[2] * n[8];
    return w;
}

/* Relaxation to zero with time constant tau (none if 0) plus noise per sqrt(second). This is the exact
 * transition, so that the frame rate does not matter and the stationary standard deviation is noise sqrt(tau
 * / 2). */
static relaxing relax(float dt, float tau, float noise)
{
    if (!(tau > 0.0f))
        return (relaxing){1.0f, noise * __builtin_sqrtf(dt)};
    float const keep = m_exp(-dt / tau), a = 2.0f * dt / tau;
    float const share = a > 0.01f ? (1.0f - keep * keep) / a : 1.0f - 0.5f * a; /* (1 - exp(-a)) / a */
    return (relaxing){keep, noise * __builtin_sqrtf(share * dt)};
}

/* Relaxation that keeps a standard deviation of 1 with this noise. */
static relaxing relax_to_one(float dt, float noise)
{
    return relax(dt, noise > 0.0f ? 2.0f / (noise * noise) : 0.0f, noise);
}

/* The value that the sum of two squared normals exceeds with probability 1 - share; infinite if share is 1. */
static float turns_beyond(float share)
{
    return (float)(-2.0 * m_log64(1.0 - (double)share));
}

dynamics_step dynamics_step_init(const dynamics *d, float dt, float age, uint32_t frame)
{
    const gait_tracker_config *const c = d->cfg;
    float const root_dt = __builtin_sqrtf(dt), mean_rate = d->rule.model->stride_hz;
    float const direction = (float)d->rule.model->direction;
    bool const settling = age < c->settle_time, several = d->rule.model->classes > 1;
    dynamics_step s = {
        .model = d->rule.model,
        .seed = d->seed,
        .frame = frame,
        .plain_root = d->rule.plain_root,
        .fields = state_layout_fields(&d->rule),
        .components = d->rule.curve_components,
        .proportion = state_layout_proportion(&d->rule),
        .offset = state_layout_offset(&d->rule),
        .dt = c->reverse > 0.0 ? -dt : dt,
        .phase_dt = direction * (c->reverse > 0.0 ? -dt : dt),
        .mean_rate = mean_rate,
        .travel = 1.0f - (float)c->belt,
        .phase_noise = fabsf(direction) * c->phase_noise * root_dt,
        /* people who stand sway, but do not drift like people who walk slowly */
        .forward_noise = (direction != 0.0f ? c->forward_noise : c->lateral_noise) * root_dt,
        .lateral_noise = c->lateral_noise * root_dt,
        .heading_noise = c->heading_noise * root_dt,
        .stature_noise =
            (settling ? c->stature_noise_start : c->stature_noise) * d->stature_sd_ratio * root_dt,
        .rate =
            relax(dt, several ? SEVERAL_RATE_TIME * c->rate_time : c->rate_time, c->rate_noise * mean_rate),
        .level = relax(dt, c->tilt_time, c->vertical_noise),
        .turn_beyond = age > 0.0f ? turns_beyond(relax(dt, c->turn_time, 0.0f).keep) : INFINITY,
        .turn_sd = c->turn_sd,
        .tilt = relax(dt, c->tilt_time, c->tilt_noise),
        .score = relax(dt, c->coef_time, c->coef_noise),
        .shape = relax_to_one(dt, c->proportion_noise),
    };
    relaxing const posture = relax_to_one(dt, c->offset_noise);
    for (int32_t k = 0; k < d->rule.offsets; k++)
        s.posture[k] =
            (relaxing){posture.keep, posture.noise * model_posture_sd(d->rule.model, d->rule.angle[k])};
    return s;
}
