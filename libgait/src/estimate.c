#include "estimate.h"
#include "fmath.h"
#include "kernels.h"
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

/* Resultant of unit vectors. */
static float resultant_length(double c, double s)
{
    return f_min((float)__builtin_sqrt(c * c + s * s), 1.0f);
}

/* Circular standard deviation, radians: sqrt(-2 log R). */
static float resultant_sd(double c, double s)
{
    return __builtin_sqrtf(f_max(-2.0f * m_log(f_max(resultant_length(c, s), 1e-6f)), 0.0f));
}

typedef struct sums { /* what an estimate sums over */
    const gait_tracker *t;
    const kernels *run;
    const crowd *of;
    double mass; /* of those of the mode, which t->mode tells */
    int32_t best;
} sums;

/* One field of the crowd; up to three at a time, each in a room of its own, 0 .. 2. */
static const float *column(const sums *s, int32_t f, int32_t room)
{
    float *const rooms[] = {s->t->ll, s->t->used, s->t->inner};
    const float *const all = field(&s->of->people, f);
    if (!s->of->who)
        return all;
    for (int32_t i = 0; i < s->of->n; i++)
        rooms[room][i] = all[s->of->who[i]];
    return rooms[room];
}

/* Mean and variance of one number per particle, and its mean in the mode. */
static void moments(const sums *s, const float *v, double *mean, double *var, double *mode)
{
    double const about = (double)v[s->best];
    double sum[3];
    s->run->estimate_moments(v, s->of->weight, s->t->mode, s->of->n, about, sum);
    double const square = sum[1] - sum[0] * sum[0];
    *mean = about + sum[0];
    *var = square > 0.0 ? square : 0.0;
    *mode = about + sum[2] / s->mass;
}

/* Cosine and sine of the mean direction over all, and over the mode. */
static void resultant(const sums *s, int32_t f, float turn, double out[4])
{
    s->run->estimate_resultant(column(s, f, 0), turn, s->of->weight, s->t->mode, s->of->n, out);
}

/* Chordal mean of Rz(heading) Ry(pitch) Rx(roll) over the mode, back as the three angles. */
static void mean_rotation(const sums *s, walker *w)
{
    double qq[16];
    float q[4];
    s->run->estimate_rotations(column(s, F_HEADING, 0), column(s, F_PITCH, 1), column(s, F_ROLL, 2),
                               s->of->weight, s->t->mode, s->of->n, qq);
    la_rotation_mean(qq, q);
    w->f[F_HEADING] = m_atan2(2.0f * (q[0] * q[3] + q[1] * q[2]), 1.0f - 2.0f * (q[2] * q[2] + q[3] * q[3]));
    w->f[F_PITCH] = m_asin(f_clamp(2.0f * (q[0] * q[2] - q[3] * q[1]), -1.0f, 1.0f));
    w->f[F_ROLL] = m_atan2(2.0f * (q[0] * q[1] + q[2] * q[3]), 1.0f - 2.0f * (q[1] * q[1] + q[2] * q[2]));
}

/* Posterior mean of every joint over all particles, and its deviation as it is reported. */
static void joints(const sums *s, float stature, gait_estimate *out)
{
    const gait_tracker *const t = s->t;
    double const factor = (double)t->cfg.joint_sd_factor, model = (double)(t->cfg.joint_sd_model * stature);
    for (int32_t p = 0; p < 3 * t->model->points; p++) {
        double mean, var, mode;
        moments(s, t->joint + (size_t)p * (size_t)s->of->n, &mean, &var, &mode);
        out->pose.joint[p / 3][p % 3] = (float)mean;
        out->joint_sd[p / 3][p % 3] = (float)__builtin_sqrt(factor * factor * var + model * model);
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

/* Means of the mode and deviations of all, field by field; phase and directions: along the line. */
static void fields(const sums *s, walker *mean, walker *sd)
{
    for (int32_t f = 0; f < s->of->people.fields; f++) {
        double all, var, mode;
        moments(s, column(s, f, 0), &all, &var, &mode);
        mean->f[f] = (float)mode;
        sd->f[f] = (float)__builtin_sqrt(var);
    }
}

walker estimate_crowd(const gait_tracker *t, const crowd *c, int32_t best, gait_estimate *out)
{
    sums s = {.t = t, .run = t->like->run, .of = c, .best = best};
    walker mean = {{0}}, sd;
    double phase[4], heading[4];
    gait_pose pose;
    s.mass = s.run->estimate_mode(column(&s, F_PHASE, 0), column(&s, F_HEADING, 1), c->weight, c->n, best,
                                  t->mode);
    fields(&s, &mean, &sd);
    resultant(&s, F_PHASE, TWO_PI_F, phase);
    resultant(&s, F_HEADING, 1.0f, heading);
    mean.f[F_PHASE] = m_wrap1(m_atan2((float)phase[3], (float)phase[2]) / TWO_PI_F);
    mean_rotation(&s, &mean);
    joints(&s, mean.f[F_STATURE], out);
    spread(t, &sd, resultant_sd(phase[0], phase[1]) / TWO_PI_F, resultant_sd(heading[0], heading[1]), out);
    walker const heaviest = walker_get(&c->people, c->who ? c->who[best] : best);
    out->mean = walker_state(&t->rule, &mean);
    out->best = walker_state(&t->rule, &heaviest);
    if (model_pose_state(t->model, &out->mean, &pose) == GAIT_OK)
        memcpy(out->pose.angle, pose.angle, sizeof pose.angle);
    out->phase_r = resultant_length(phase[0], phase[1]);
    out->mode_mass = (float)s.mass;
    out->speed = estimate_speed(t, &mean);
    return mean;
}

walker estimate_fill(const gait_tracker *t, int32_t best, gait_estimate *out)
{
    crowd const all = {.people = t->people, .n = t->people.n, .weight = t->filter.weight};
    return estimate_crowd(t, &all, best, out);
}
