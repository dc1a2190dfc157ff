#include "tracker/estimate.h"
#include "image/camera.h"
#include "base/fmath.h"
#include "base/dispatch.h"
#include "base/linalg.h"
#include <string.h>

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

typedef struct moments { /* of one number per particle */
    double mean, var;
    double mode; /* its mean in the mode */
} moments;

typedef struct sums { /* what an estimate sums over, */
    const gait_tracker *t;
    const kernels *run;
    const crowd *of;
    double mass; /* of those of the mode, which t->mode tells */
    int32_t best;
    moments field[F_MAX], joint[3 * GAIT_MAX_JOINTS]; /* and what comes of it */
    double phase[4], heading[4], rotation[16];
} sums;

/* One field of the crowd; up to three at a time, each in a room of its own, 0 .. 2. */
static const float *column(const sums *s, int32_t f, int32_t room)
{
    float *const rooms[] = {s->t->loglik_raw, s->t->loglik, s->t->loglik_without_silhouette};
    const float *const all = field(&s->of->particles, f);
    if (!s->of->who)
        return all;
    for (int32_t i = 0; i < s->of->n; i++)
        rooms[room][i] = all[s->of->who[i]];
    return rooms[room];
}

static moments moments_of(const sums *s, const float *v)
{
    double const about = (double)v[s->best];
    double sum[3];
    s->run->estimate_moments(v, s->of->weight, s->t->mode, s->of->n, about, sum);
    double const square = sum[1] - sum[0] * sum[0];
    return (moments){about + sum[0], square > 0.0 ? square : 0.0, about + sum[2] / s->mass};
}

/* Cosine and sine of the mean direction over all, and over the mode. */
static void resultant(const sums *s, int32_t f, float turn, double out[4])
{
    s->run->estimate_resultant(column(s, f, 0), turn, s->of->weight, s->t->mode, s->of->n, out);
}

enum { SUM_PHASE, SUM_HEADING, SUM_ROTATION, SUM_FIELDS }; /* then the fields, then the joints */

static void sums_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    sums *const s = ctx;
    int32_t const joints = SUM_FIELDS + s->of->particles.fields;
    (void)task;
    for (int32_t k = begin; k < end; k++)
        if (k == SUM_PHASE)
            resultant(s, F_PHASE, TWO_PI_F, s->phase);
        else if (k == SUM_HEADING)
            resultant(s, F_HEADING, 1.0f, s->heading);
        else if (k == SUM_ROTATION)
            s->run->estimate_rotations(column(s, F_HEADING, 0), column(s, F_PITCH, 1), column(s, F_ROLL, 2),
                                       s->of->weight, s->t->mode, s->of->n, s->rotation);
        else if (k < joints)
            s->field[k - SUM_FIELDS] = moments_of(s, column(s, k - SUM_FIELDS, 0));
        else
            s->joint[k - joints] = moments_of(s, s->t->joint + (size_t)(k - joints) * (size_t)s->of->n);
}

/* A crowd that has to be gathered is, in one place, so that its sums come one after the other. */
static void sum_up(sums *s)
{
    static const gait_tasks here = {NULL, NULL};
    const gait_tasks *const exec = s->of->who ? &here : &s->t->cfg.exec;
    task_run(exec, s->t->cfg.tasks, SUM_FIELDS + s->of->particles.fields + 3 * s->t->model->points, 1,
             sums_range, s);
}

/* Chordal mean of Rz(heading) Ry(pitch) Rx(roll) over the mode, back as the three angles. */
static void mean_rotation(const sums *s, particle_state *w)
{
    float q[4];
    la_rotation_mean(s->rotation, q);
    w->f[F_HEADING] = m_atan2(2.0f * (q[0] * q[3] + q[1] * q[2]), 1.0f - 2.0f * (q[2] * q[2] + q[3] * q[3]));
    w->f[F_PITCH] = m_asin(f_clamp(2.0f * (q[0] * q[2] - q[3] * q[1]), -1.0f, 1.0f));
    w->f[F_ROLL] = m_atan2(2.0f * (q[0] * q[1] + q[2] * q[3]), 1.0f - 2.0f * (q[1] * q[1] + q[2] * q[2]));
}

/* Deviation of the person's size and, with it, of the distance, as a share of them.  Soles, hair and clothes are the
 * same in all frames of one camera: whatever the particles agree on, these tell a size that was in doubt to 1 %. */
static float size_doubt(const gait_tracker *t)
{
    float const told = 0.01f, doubt = t->core->stature_sd_ratio;
    bool const one_view = t->cfg.cameras == 1 && t->cfg.joint_sd_model > 0.0f;
    return one_view ? told * doubt / __builtin_sqrtf(told * told + doubt * doubt) : 0.0f;
}

static float with_doubt(double var, float a, float b)
{
    return (float)__builtin_sqrt(var + (double)a * (double)a + (double)b * (double)b);
}

/* Posterior mean of every joint over all particles, and its deviation as it is reported. */
static void joints(const sums *s, float stature, gait_estimate *out)
{
    const gait_tracker *const t = s->t;
    float const model = t->cfg.joint_sd_model * stature, size = size_doubt(t);
    for (int32_t p = 0; p < t->model->points; p++) {
        float *const at = out->pose.joint[p], ray[3];
        for (int32_t k = 0; k < 3; k++)
            at[k] = (float)s->joint[3 * p + k].mean;
        camera_to(&t->cfg.camera[0], at, ray);
        for (int32_t k = 0; k < 3; k++)
            out->joint_sd[p][k] = with_doubt(s->joint[3 * p + k].var, model, size * ray[k]);
    }
}

/* The stride's length is the mean of its forward speed over the phase. */
float estimate_speed(const gait_tracker *t, const particle_state *w)
{
    const gait_model *const m = t->model;
    float sum = 0.0f;
    if (t->rule.plain_root)
        return w->f[F_STATURE] * w->f[F_RATE] * m->stride_length;
    for (int32_t j = 0; j < m->phases; j++)
        sum += root_channel(m, ROOT_FORWARD, (float)j / (float)m->phases,
                            state_layout_pace(&t->rule, w->f[F_RATE]), w->f + F_COEF, t->rule.components);
    return w->f[F_STATURE] * w->f[F_RATE] * sum / (float)m->phases;
}

/* Deviation of the pelvis: its joint is point 0 of every model. */
static void spread(const gait_tracker *t, const particle_state *sd, float phase_sd, float heading_sd,
                   gait_estimate *out)
{
    out->sd = (gait_state){.phase = phase_sd,
                           .stride_hz = sd->f[F_RATE],
                           .stature = sd->f[F_STATURE],
                           .heading = heading_sd,
                           .pitch = sd->f[F_PITCH],
                           .roll = sd->f[F_ROLL],
                           .turn_rate = sd->f[F_TURN]};
    for (int32_t k = 0; k < 3; k++)
        out->sd.pelvis[k] = out->joint_sd[0][k];
    for (int32_t k = 0; k < t->rule.components; k++)
        out->sd.coef[k] = sd->f[F_COEF + k];
    for (int32_t k = 0; k < t->rule.proportions; k++)
        out->sd.proportion[k] = sd->f[state_layout_proportion(&t->rule) + k];
    for (int32_t k = 0; k < t->rule.offsets; k++)
        out->sd.offset[t->rule.angle[k]] = sd->f[state_layout_offset(&t->rule) + k];
}

/* Means of the mode and deviations of all, field by field; phase and directions: along the line.  Stature: as it is
 * reported. */
static void fields(const sums *s, particle_state *mean, particle_state *sd)
{
    for (int32_t f = 0; f < s->of->particles.fields; f++) {
        mean->f[f] = (float)s->field[f].mode;
        sd->f[f] = (float)__builtin_sqrt(s->field[f].var);
    }
    sd->f[F_STATURE] = with_doubt(s->field[F_STATURE].var, size_doubt(s->t) * mean->f[F_STATURE], 0.0f);
}

particle_state estimate_crowd(const gait_tracker *t, const crowd *c, int32_t best, gait_estimate *out)
{
    sums s = {.t = t, .run = t->like->run, .of = c, .best = best};
    particle_state mean = {{0}}, sd;
    gait_state shown;
    gait_pose pose;
    s.mass = s.run->estimate_mode(column(&s, F_PHASE, 0), column(&s, F_HEADING, 1), c->weight, c->n, best,
                                  t->mode);
    sum_up(&s);
    fields(&s, &mean, &sd);
    mean.f[F_PHASE] = m_wrap1(m_atan2((float)s.phase[3], (float)s.phase[2]) / TWO_PI_F);
    mean_rotation(&s, &mean);
    joints(&s, mean.f[F_STATURE], out);
    spread(t, &sd, resultant_sd(s.phase[0], s.phase[1]) / TWO_PI_F, resultant_sd(s.heading[0], s.heading[1]),
           out);
    particle_state const heaviest = particle_get(&c->particles, c->who ? c->who[best] : best);
    out->mean = particle_to_state(&t->rule, &mean);
    out->best = particle_to_state(&t->rule, &heaviest);
    shown = out->mean;
    if (t->rule.plain_root)
        shown.stride_hz = 0.0f; /* particles of the paper walk alike at any rate */
    if (model_pose_state(t->model, &shown, &pose) == GAIT_OK)
        memcpy(out->pose.angle, pose.angle, sizeof pose.angle);
    out->phase_r = resultant_length(s.phase[0], s.phase[1]);
    out->hypothesis_weight = (float)s.mass;
    out->speed = estimate_speed(t, &mean);
    return mean;
}

particle_state estimate_fill(const gait_tracker *t, int32_t best, gait_estimate *out)
{
    crowd const all = {.particles = t->particles, .n = t->particles.n, .weight = t->filter.weight};
    return estimate_crowd(t, &all, best, out);
}
