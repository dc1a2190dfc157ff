#include "dynamics.h"
#include "fmath.h"
#include "rng.h"

enum { NORMALS = 4 * ((F_MAX + 3) / 4) };

static const float RATE_MIN = 1.0f / 2.1f, RATE_MAX = 1.0f / 0.4f; /* strides per second (spec, eq. 7) */

static void normals(const dynamics *d, uint32_t stream, uint32_t frame, int32_t i, int32_t count, float *out)
{
    for (int32_t k = 0; k < count; k += 4)
        rng_normal4(d->seed, stream, frame, (uint32_t)i, (uint32_t)(k / 4), out + k);
}

/* Fold a value back into [lo, hi]. */
static float reflect(float x, float lo, float hi)
{
    float const y = x < lo ? 2.0f * lo - x : x > hi ? 2.0f * hi - x : x;
    return f_clamp(y, lo, hi);
}

walker dynamics_draw(const dynamics *d, const gait_state *mean, const gait_state *sd, int32_t i)
{
    float const level_sd = 0.03f; /* metres: how far the ground may be from z = 0 */
    int32_t const q = d->rule.components;
    float n[NORMALS], u[4];
    gait_state s = *mean;
    normals(d, STREAM_START, 0, i, body_rule_fields(&d->rule), n);
    rng_uniform4(d->seed, STREAM_START, 1, (uint32_t)i, 0, u);
    s.phase = sd->phase >= 0.5f ? u[0] : m_wrap1(mean->phase + sd->phase * n[0]);
    s.heading = sd->heading >= PI_F ? TWO_PI_F * u[1] : mean->heading + sd->heading * n[1];
    s.stride_hz = reflect(mean->stride_hz + sd->stride_hz * n[2], RATE_MIN, RATE_MAX);
    s.stature = f_max(mean->stature + sd->stature * n[3], 0.3f);
    s.pitch += sd->pitch * n[4];
    s.roll += sd->roll * n[5];
    s.pelvis[0] += sd->pelvis[0] * n[6];
    s.pelvis[1] += sd->pelvis[1] * n[7];
    for (int32_t k = 0; k < q; k++)
        s.coef[k] += sd->coef[k] * n[F_COEF + k];
    for (int32_t k = 0; k < d->rule.proportions; k++)
        s.proportion[k] += sd->proportion[k] * n[body_rule_proportion(&d->rule) + k];
    for (int32_t k = 0; k < d->rule.offsets; k++) {
        int32_t const a = d->rule.angle[k];
        s.offset[a] += sd->offset[a] * n[body_rule_offset(&d->rule) + k];
    }
    walker w = walker_from_state(&d->rule, &s);
    /* The given height of the pelvis and the ground at z = 0 are two measurements of one level (paper:
     * one). */
    float const var = sd->pelvis[2] * sd->pelvis[2];
    float const trust = d->rule.plain_root ? 1.0f : level_sd * level_sd / (level_sd * level_sd + var);
    w.f[F_Z] = trust * w.f[F_Z] + __builtin_sqrtf(trust) * sd->pelvis[2] * n[8];
    return w;
}

/* Return to zero with time constant tau (never if 0), plus noise per sqrt(second): the exact transition,
 * so that the frame rate does not matter and the stationary deviation is noise sqrt(tau / 2). */
static float relax(float x, float dt, float tau, float noise, float n)
{
    if (!(tau > 0.0f))
        return x + noise * __builtin_sqrtf(dt) * n;
    float const keep = m_exp(-dt / tau), a = 2.0f * dt / tau;
    float const share = a > 0.01f ? (1.0f - keep * keep) / a : 1.0f - 0.5f * a; /* (1 - exp(-a)) / a */
    return keep * x + noise * __builtin_sqrtf(share * dt) * n;
}

/* The time constant that keeps a deviation sd with so much noise. */
static float time_for(float sd, float noise)
{
    return noise > 0.0f ? 2.0f * sd * sd / (noise * noise) : 0.0f;
}

walker dynamics_move(const dynamics *d, const walker *from, float dt, float age, uint32_t frame, int32_t i)
{
    const gait_tracker_config *const c = d->cfg;
    const gait_model *const m = d->rule.model;
    int32_t const q = d->rule.components;
    float const root_dt = __builtin_sqrtf(dt);
    bool const settling = age < c->settle_time;
    float n[NORMALS], sn, cs;
    walker w = *from;
    normals(d, STREAM_MOVE, frame, i, body_rule_fields(&d->rule), n);

    /* eqs. 6 and 7: phase advances by the previous rate; the rate diffuses */
    float const turn = from->f[F_RATE] * dt + c->phase_noise * root_dt * n[0];
    float const rate_sd = (settling ? c->rate_noise_start : c->rate_noise) * m->stride_hz;
    w.f[F_PHASE] = m_wrap1(from->f[F_PHASE] + turn);
    w.f[F_RATE] = m->stride_hz + relax(from->f[F_RATE] - m->stride_hz, dt, c->rate_time, rate_sd, n[1]);
    w.f[F_RATE] = reflect(w.f[F_RATE], RATE_MIN, RATE_MAX);

    /* eq. 8: forward along the previous heading, by the stride's own speed profile unless in paper mode */
    float const speed = d->rule.plain_root ? m->stride_length
                                           : root_channel(m, ROOT_FORWARD, from->f[F_PHASE] + 0.5f * turn,
                                                          from->f + F_COEF, q);
    float const ahead = from->f[F_STATURE] * speed * (d->rule.plain_root ? from->f[F_RATE] * dt : turn) +
                        c->forward_noise * root_dt * n[2];
    float const aside = c->lateral_noise * root_dt * n[3];
    m_sincos(from->f[F_HEADING], &sn, &cs);
    w.f[F_X] += ahead * cs - aside * sn;
    w.f[F_Y] += ahead * sn + aside * cs;

    /* eq. 9, and the level of the ground: tilt and level return to the model's own */
    w.f[F_Z] = relax(from->f[F_Z], dt, c->tilt_time, c->vertical_noise, n[4]);
    w.f[F_HEADING] = m_wrap_pi(from->f[F_HEADING] + c->heading_noise * root_dt * n[5]);
    w.f[F_PITCH] = relax(from->f[F_PITCH], dt, c->tilt_time, c->tilt_noise, n[6]);
    w.f[F_ROLL] = relax(from->f[F_ROLL], dt, c->tilt_time, c->tilt_noise, n[7]);

    /* stature moves only while settling; the scores relax to the population (eq. 5) */
    if (settling)
        w.f[F_STATURE] = f_max(from->f[F_STATURE] * (1.0f + c->stature_noise * root_dt * n[8]), 0.3f);
    for (int32_t k = 0; k < q; k++)
        w.f[F_COEF + k] = relax(from->f[F_COEF + k], dt, c->coef_time, c->coef_noise, n[F_COEF + k]);
    /* proportions and posture hardly change */
    for (int32_t k = body_rule_proportion(&d->rule); k < body_rule_offset(&d->rule); k++)
        w.f[k] = relax(from->f[k], dt, time_for(1.0f, c->proportion_noise), c->proportion_noise, n[k]);
    for (int32_t k = body_rule_offset(&d->rule); k < body_rule_fields(&d->rule); k++)
        w.f[k] = relax(from->f[k], dt, time_for(c->offset_sd, c->offset_noise), c->offset_noise, n[k]);
    return w;
}
