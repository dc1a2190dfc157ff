#include "estimate.h"
#include "fmath.h"
#include "linalg.h"
#include <string.h>

walker estimate_place(const population *p, const double *weight)
{
    static const int32_t FIELDS[] = {F_X, F_Y, F_Z, F_STATURE};
    walker w = {{0}};
    for (size_t k = 0; k < sizeof FIELDS / sizeof *FIELDS; k++) {
        const float *const v = field(p, FIELDS[k]);
        double sum = 0.0;
        for (int32_t i = 0; i < p->n; i++)
            sum += weight[i] * (double)v[i];
        w.f[FIELDS[k]] = (float)sum;
    }
    return w;
}

typedef struct circular { /* resultant of unit vectors */
    double c, s;
} circular;

static circular resultant(const float *angle, float turn, const double *weight, const uint8_t *use, int32_t n)
{
    circular r = {0.0, 0.0};
    for (int32_t i = 0; i < n; i++) {
        float sn, cs;
        if (use && !use[i])
            continue;
        m_sincos(turn * angle[i], &sn, &cs);
        r.c += weight[i] * (double)cs;
        r.s += weight[i] * (double)sn;
    }
    return r;
}

static float resultant_length(circular r)
{
    return f_min((float)__builtin_sqrt(r.c * r.c + r.s * r.s), 1.0f);
}

/* Circular standard deviation, radians: sqrt(-2 log R). */
static float resultant_sd(circular r)
{
    return __builtin_sqrtf(f_max(-2.0f * m_log(f_max(resultant_length(r), 1e-6f)), 0.0f));
}

/* Particles near the heaviest one in phase and heading; returns their weight. */
static double dominant_mode(const population *p, const double *weight, int32_t best, uint8_t *use)
{
    float const near_phase = 0.15f, near_heading = 0.5f;
    const float *const phase = field(p, F_PHASE), *const heading = field(p, F_HEADING);
    double mass = 0.0;
    for (int32_t i = 0; i < p->n; i++) {
        float const dp = TWO_PI_F * (phase[i] - phase[best]), dh = heading[i] - heading[best];
        use[i] = fabsf(m_wrap_pi(dp)) < TWO_PI_F * near_phase && fabsf(m_wrap_pi(dh)) < near_heading;
        mass += use[i] ? weight[i] : 0.0;
    }
    return mass;
}

static void mean_and_sd(const float *v, const double *weight, const uint8_t *use, double mass, int32_t n,
                        float *mean, float *sd)
{
    double sum = 0.0, all = 0.0, square = 0.0;
    for (int32_t i = 0; i < n; i++) {
        sum += use[i] ? weight[i] * (double)v[i] : 0.0;
        all += weight[i] * (double)v[i];
    }
    for (int32_t i = 0; i < n; i++) {
        double const d = (double)v[i] - all;
        square += weight[i] * d * d;
    }
    *mean = (float)(sum / mass);
    *sd = (float)__builtin_sqrt(square);
}

/* Chordal mean of Rz(heading) Ry(pitch) Rx(roll) over the mode, back as the three angles. */
static void mean_rotation(const population *p, const double *weight, const uint8_t *use, walker *w)
{
    double qq[16] = {0};
    float q[4];
    for (int32_t i = 0; i < p->n; i++) {
        float sh, ch, sp, cp, sr, cr;
        if (!use[i])
            continue;
        m_sincos(0.5f * field(p, F_HEADING)[i], &sh, &ch);
        m_sincos(0.5f * field(p, F_PITCH)[i], &sp, &cp);
        m_sincos(0.5f * field(p, F_ROLL)[i], &sr, &cr);
        float const v[4] = {ch * cp * cr + sh * sp * sr, ch * cp * sr - sh * sp * cr,
                            ch * sp * cr + sh * cp * sr, sh * cp * cr - ch * sp * sr};
        for (int32_t a = 0; a < 4; a++)
            for (int32_t b = 0; b < 4; b++)
                qq[4 * a + b] += weight[i] * (double)(v[a] * v[b]);
    }
    la_rotation_mean(qq, q);
    w->f[F_HEADING] = m_atan2(2.0f * (q[0] * q[3] + q[1] * q[2]), 1.0f - 2.0f * (q[2] * q[2] + q[3] * q[3]));
    w->f[F_PITCH] = m_asin(f_clamp(2.0f * (q[0] * q[2] - q[3] * q[1]), -1.0f, 1.0f));
    w->f[F_ROLL] = m_atan2(2.0f * (q[0] * q[1] + q[2] * q[3]), 1.0f - 2.0f * (q[1] * q[1] + q[2] * q[2]));
}

/* Posterior mean of every joint over all particles, and its deviation as it is reported. */
static void joints(const gait_tracker *t, float stature, gait_estimate *out)
{
    double const factor = (double)t->cfg.joint_sd_factor, model = (double)(t->cfg.joint_sd_model * stature);
    int32_t const n = t->cfg.particles;
    const double *const weight = t->filter.weight;
    for (int32_t p = 0; p < 3 * t->model->points; p++) {
        const float *const v = t->joint + (size_t)p * (size_t)n;
        double sum = 0.0, square = 0.0;
        for (int32_t i = 0; i < n; i++)
            sum += weight[i] * (double)v[i];
        for (int32_t i = 0; i < n; i++)
            square += weight[i] * ((double)v[i] - sum) * ((double)v[i] - sum);
        out->pose.joint[p / 3][p % 3] = (float)sum;
        out->joint_sd[p / 3][p % 3] = (float)__builtin_sqrt(factor * factor * square + model * model);
    }
}

/* The stride's length is the mean of its forward speed over the phase. */
float estimate_speed(const gait_tracker *t, const walker *w)
{
    const gait_model *const m = t->model;
    float sum = 0.0f;
    if (t->rule.plain_root)
        return w->f[F_STATURE] * w->f[F_RATE] * m->stride_length;
    for (int32_t j = 0; j < m->phases; j++)
        sum += root_channel(m, ROOT_FORWARD, (float)j / (float)m->phases, w->f + F_COEF, t->rule.components);
    return w->f[F_STATURE] * w->f[F_RATE] * sum / (float)m->phases;
}

/* Deviation of the pelvis: its joint is point 0 of every model. */
static void spread(const gait_tracker *t, const walker *sd, float phase_sd, float heading_sd,
                   gait_estimate *out)
{
    out->sd = (gait_state){.phase = phase_sd,
                           .stride_hz = sd->f[F_RATE],
                           .stature = sd->f[F_STATURE],
                           .heading = heading_sd,
                           .pitch = sd->f[F_PITCH],
                           .roll = sd->f[F_ROLL]};
    for (int32_t k = 0; k < 3; k++)
        out->sd.pelvis[k] = out->joint_sd[0][k];
    for (int32_t k = 0; k < t->rule.components; k++)
        out->sd.coef[k] = sd->f[F_COEF + k];
    for (int32_t k = 0; k < t->rule.proportions; k++)
        out->sd.proportion[k] = sd->f[body_rule_proportion(&t->rule) + k];
    for (int32_t k = 0; k < t->rule.offsets; k++)
        out->sd.offset[t->rule.angle[k]] = sd->f[body_rule_offset(&t->rule) + k];
}

walker estimate_fill(const gait_tracker *t, int32_t best, gait_estimate *out)
{
    const population *const p = &t->gen[t->core->current].people;
    const double *const weight = t->filter.weight;
    uint8_t *const use = t->mode;
    double const mass = dominant_mode(p, weight, best, use);
    walker mean = {{0}}, sd;
    for (int32_t f = 0; f < p->fields; f++)
        mean_and_sd(field(p, f), weight, use, mass, p->n, &mean.f[f], &sd.f[f]);
    circular const phase = resultant(field(p, F_PHASE), TWO_PI_F, weight, NULL, p->n);
    circular const mode = resultant(field(p, F_PHASE), TWO_PI_F, weight, use, p->n);
    mean.f[F_PHASE] = m_wrap1(m_atan2((float)mode.s, (float)mode.c) / TWO_PI_F);
    mean_rotation(p, weight, use, &mean);
    joints(t, mean.f[F_STATURE], out);
    spread(t, &sd, resultant_sd(phase) / TWO_PI_F,
           resultant_sd(resultant(field(p, F_HEADING), 1.0f, weight, NULL, p->n)), out);
    walker const heaviest = walker_get(p, best);
    gait_pose pose;
    out->mean = walker_state(&t->rule, &mean);
    out->best = walker_state(&t->rule, &heaviest);
    if (model_pose_state(t->model, &out->mean, &pose) == GAIT_OK)
        memcpy(out->pose.angle, pose.angle, sizeof pose.angle);
    out->phase_r = resultant_length(phase);
    out->mode_mass = (float)mass;
    out->speed = estimate_speed(t, &mean);
    return mean;
}
