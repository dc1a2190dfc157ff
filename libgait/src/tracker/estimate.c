#include "tracker/estimate.h"
#include "base/dispatch.h"
#include "base/fmath.h"
#include "base/linalg.h"
#include "image/camera.h"
#include "tracker/class_strata.h"
#include "tracker/likelihood_step.h"
#include "tracker/pose_error.h"
#include <string.h>

/* Standard deviation of a stature from one camera, as a fraction: soles, hair and clothes are the same in all frames,
 * so the images measure an unknown stature no better however much the particles agree. */
static const float MEASURED_STATURE_REL_SD = 0.01f;

typedef struct moments { /* of one number per particle */
    double mean, var;
    double dominant; /* mean over the dominant hypothesis */
} moments;

typedef struct sums {
    const gait_tracker *t;
    const kernels *run;
    const weighted_particles *of;
    int32_t best;
    int32_t first; /* particle whose joints are the first in t->joints */
    double weight; /* of the dominant hypothesis */
    moments field[F_MAX], joint[3 * GAIT_MAX_JOINTS];
    double phase[4], heading[4]; /* mean cosine and sine: over all, then over the dominant hypothesis */
    double rotation[16];         /* sum of the outer products of quaternions over the dominant hypothesis */
} sums;

/* ---- sums over the particles ---- */
/* A field of the particles; those of an index are gathered in one of three arrays. */
static const float *column(const sums *s, int32_t f, int32_t array)
{
    float *const gathered = s->t->lag.column[array];
    const float *const all = field(&s->of->all, f);
    if (!s->of->index)
        return all;
    for (int32_t i = 0; i < s->of->n; i++)
        gathered[i] = all[s->of->index[i]];
    return gathered;
}

/* From the running sums about a value. */
static moments moments_about(const sums *s, double about, const double (*lane)[SUM_LANES])
{
    double sum[3] = {0.0};
    for (int32_t k = 0; k < 3; k++)
        for (int32_t i = 0; i < SUM_LANES; i++)
            sum[k] += lane[k][i];
    double const square = sum[1] - sum[0] * sum[0];
    return (moments){about + sum[0], square > 0.0 ? square : 0.0, about + sum[2] / s->weight};
}

static moments moments_of(const sums *s, const float *v)
{
    double const about = (double)v[s->best];
    double sum[3][SUM_LANES] = {{0.0}};
    s->run->estimate_moments(v, s->of->weight, s->t->dominant, s->of->n, about, sum);
    return moments_about(s, about, (const double (*)[SUM_LANES])sum);
}

static void mean_direction(const sums *s, int32_t f, float turn, double out[4])
{
    s->run->estimate_resultant(column(s, f, 0), turn, s->of->weight, s->t->dominant, s->of->n, out);
}

enum { SUM_PHASE, SUM_HEADING, SUM_ROTATION, SUM_FIELDS }; /* items of the tasks: then the fields */

static void sums_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    sums *const s = ctx;
    (void)task;
    for (int32_t k = begin; k < end; k++)
        if (k == SUM_PHASE)
            mean_direction(s, F_PHASE, TWO_PI_F, s->phase);
        else if (k == SUM_HEADING)
            mean_direction(s, F_HEADING, 1.0f, s->heading);
        else if (k == SUM_ROTATION)
            s->run->estimate_rotations(column(s, F_HEADING, 0), column(s, F_PITCH, 1), column(s, F_ROLL, 2),
                                       s->of->weight, s->t->dominant, s->of->n, s->rotation);
        else
            s->field[k - SUM_FIELDS] = moments_of(s, column(s, k - SUM_FIELDS, 0));
}

/* ---- joints ---- */
/* Place the bodies of particles first .. first + lanes - 1, of one class, and their joints. */
static void place(const sums *s, int32_t first, int32_t lanes, likelihood_scratch *w)
{
    const weighted_particles *const p = s->of;
    int32_t const motion_class = p->strata ? p->strata->motion_class[stratum_at(p->strata, first)] : 0;
    const state_layout *const layout = &s->t->layouts[motion_class];
    particle_block block;
    if (!p->index)
        particle_set_bodies(layout, &p->all, first, &w->body);
    else {
        particle_block_get(&p->all, p->index + first, lanes, &block);
        particle_block_bodies(layout, &block, &w->body);
    }
    kin_points(s->t->model, &w->body, w->points);
}

/* Joints of particles s->first + begin .. s->first + end - 1. */
static void place_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const sums *const s = ctx;
    likelihood_scratch *const w = &s->t->work[task];
    for (int32_t lanes; begin < end; begin += lanes) {
        int32_t const first = s->first + begin;
        lanes = i_min(BLOCK, end - begin);
        if (s->of->strata)
            lanes = i_min(lanes, s->of->strata->first[stratum_at(s->of->strata, first) + 1] - first);
        place(s, first, lanes, w);
        joints_put(s->t, begin, lanes, w);
    }
}

static int32_t joints_at_once(const sums *s)
{
    return i_min(s->of->n - s->first, s->t->joints.most);
}

/* Add some of the joints' numbers to their running sums. */
static void joints_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const sums *const s = ctx;
    const joint_scratch *const j = &s->t->joints;
    (void)task;
    for (int32_t k = begin; k < end; k++)
        s->run->estimate_moments(j->value + (size_t)k * (size_t)j->most, s->of->weight + s->first,
                                 s->t->dominant + s->first, joints_at_once(s), s->joint[k].mean, j->sum[k]);
}

static void sum_joints(sums *s, const gait_tasks *exec)
{
    const gait_tracker *const t = s->t;
    int32_t const numbers = 3 * t->model->points;
    bool const kept = !s->of->index && s->of->n <= t->joints.most;
    place(s, s->best, 1, t->work);
    for (int32_t k = 0; k < numbers; k++)
        s->joint[k].mean = (double)t->work->points[k / 3][k % 3][0];
    memset(t->joints.sum, 0, (size_t)numbers * sizeof *t->joints.sum);
    for (s->first = 0; s->first < s->of->n; s->first += t->joints.most) {
        if (!kept)
            task_run(exec, t->cfg.tasks, joints_at_once(s), BLOCK, place_range, s);
        task_run(exec, t->cfg.tasks, numbers, 1, joints_range, s);
    }
    for (int32_t k = 0; k < numbers; k++)
        s->joint[k] = moments_about(s, s->joint[k].mean, (const double (*)[SUM_LANES])t->joints.sum[k]);
}

/* Gathered fields share one array, and scratch of other tasks holds their index: their sums are made one after the other. */
static void sum_up(sums *s)
{
    static const gait_tasks calling_thread = {NULL, NULL};
    const gait_tasks *const exec = s->of->index ? &calling_thread : &s->t->cfg.exec;
    task_run(exec, s->t->cfg.tasks, SUM_FIELDS + s->of->all.fields, 1, sums_range, s);
    sum_joints(s, exec);
}

/* ---- what is reported ---- */
static float resultant_length(const double cos_sin[2])
{
    return f_min((float)__builtin_sqrt(cos_sin[0] * cos_sin[0] + cos_sin[1] * cos_sin[1]), 1.0f);
}

/* Circular standard deviation, radians: sqrt(-2 log R). */
static float circular_sd(const double cos_sin[2])
{
    return __builtin_sqrtf(f_max(-2.0f * m_log(f_max(resultant_length(cos_sin), 1e-6f)), 0.0f));
}

/* Chordal mean of Rz(heading) Ry(pitch) Rx(roll) over the dominant hypothesis, as the three angles. */
static void mean_rotation(const sums *s, particle_state *p)
{
    float q[4];
    la_rotation_mean(s->rotation, q);
    p->f[F_HEADING] = m_atan2(2.0f * (q[0] * q[3] + q[1] * q[2]), 1.0f - 2.0f * (q[2] * q[2] + q[3] * q[3]));
    p->f[F_PITCH] = m_asin(f_clamp(2.0f * (q[0] * q[2] - q[3] * q[1]), -1.0f, 1.0f));
    p->f[F_ROLL] = m_atan2(2.0f * (q[0] * q[1] + q[2] * q[3]), 1.0f - 2.0f * (q[1] * q[1] + q[2] * q[2]));
}

/* Standard deviation of the person's size, and so of the distance from a single camera, as a fraction of both. */
static float size_rel_sd(const gait_tracker *t)
{
    float const measured = MEASURED_STATURE_REL_SD, start = t->core->stature_sd_ratio;
    bool const one_view = t->cfg.cameras == 1 && t->cfg.joint_sd_model > 0.0f;
    return one_view ? measured * start / __builtin_sqrtf(measured * measured + start * start) : 0.0f;
}

static float combined_sd(double var, float a, float b)
{
    return (float)__builtin_sqrt(var + (double)a * (double)a + (double)b * (double)b);
}

/* Posterior mean of every joint over all particles, and its standard deviation. */
static void report_joints(const sums *s, float stature, gait_estimate *out)
{
    const gait_tracker *const t = s->t;
    float const model = t->cfg.joint_sd_model * stature, size = size_rel_sd(t);
    for (int32_t p = 0; p < t->model->points; p++) {
        float *const at = out->pose.joint[p], ray[3];
        for (int32_t k = 0; k < 3; k++)
            at[k] = (float)s->joint[3 * p + k].mean;
        camera_to(&t->cfg.camera[0], at, ray);
        double const pose = pose_error_variance(t, at);
        for (int32_t k = 0; k < 3; k++)
            out->joint_sd[p][k] = combined_sd(s->joint[3 * p + k].var + pose, model, size * ray[k]);
    }
}

/* The pelvis is joint 0 of every model. */
static void report_sd(const sums *s, float stature, gait_estimate *out)
{
    const state_layout *const layout = &s->t->layout;
    particle_state sd;
    for (int32_t f = 0; f < s->of->all.fields; f++)
        sd.f[f] = (float)__builtin_sqrt(s->field[f].var);
    out->sd = (gait_state){.phase = circular_sd(s->phase) / TWO_PI_F,
                           .stride_hz = sd.f[F_RATE],
                           .stature = combined_sd(s->field[F_STATURE].var, size_rel_sd(s->t) * stature, 0.0f),
                           .heading = circular_sd(s->heading),
                           .pitch = sd.f[F_PITCH],
                           .roll = sd.f[F_ROLL],
                           .turn_rate = sd.f[F_TURN]};
    for (int32_t k = 0; k < 3; k++)
        out->sd.pelvis[k] = out->joint_sd[0][k];
    for (int32_t k = 0; k < layout->components; k++)
        out->sd.coef[k] = sd.f[F_COEF + k];
    for (int32_t k = 0; k < layout->proportions; k++)
        out->sd.proportion[k] = sd.f[state_layout_proportion(layout) + k];
    for (int32_t k = 0; k < layout->offsets; k++)
        out->sd.offset[layout->angle[k]] = sd.f[state_layout_offset(layout) + k];
}

static particle_state dominant_mean(const sums *s)
{
    particle_state mean = {{0}};
    for (int32_t f = 0; f < s->of->all.fields; f++)
        mean.f[f] = (float)s->field[f].dominant;
    mean.f[F_PHASE] = m_wrap1(m_atan2((float)s->phase[3], (float)s->phase[2]) / TWO_PI_F);
    mean_rotation(s, &mean);
    return mean;
}

/* Mark the particles of the class that are near the best one. */
static void mark_dominant(sums *s, int32_t motion_class)
{
    const weighted_particles *const p = s->of;
    uint8_t *const dominant = s->t->dominant;
    const float *const phase = column(s, F_PHASE, 0), *const heading = column(s, F_HEADING, 1);
    if (!p->strata) {
        s->weight = s->run->estimate_dominant(phase, heading, p->weight, p->n, s->best, dominant);
        return;
    }
    memset(dominant, 0, (size_t)p->n);
    for (int32_t k = 0; k < p->strata->count; k++) {
        int32_t const first = p->strata->first[k], count = p->strata->first[k + 1] - first;
        if (p->strata->motion_class[k] == motion_class && count > 0)
            s->weight += s->run->estimate_dominant(phase + first, heading + first, p->weight + first, count,
                                                   s->best - first, dominant + first);
    }
}

static void report_classes(const weighted_particles *p, int32_t motion_class, gait_estimate *out)
{
    double probability[GAIT_MAX_CLASSES] = {1.0};
    if (p->strata)
        class_strata_probability(p->strata, p->weight, probability);
    for (int32_t c = 0; c < GAIT_MAX_CLASSES; c++)
        out->class_probability[c] = (float)probability[c];
    out->motion_class = motion_class;
}

particle_state estimate_weighted(const gait_tracker *t, const weighted_particles *p, int32_t best,
                                 gait_estimate *out)
{
    sums s = {.t = t, .run = t->like->run, .of = p, .best = best};
    gait_pose pose;
    int32_t const motion_class = p->strata ? p->strata->motion_class[stratum_at(p->strata, best)] : 0;
    const state_layout *const layout = &t->layouts[motion_class];
    mark_dominant(&s, motion_class);
    sum_up(&s);
    particle_state const mean = dominant_mean(&s);
    particle_state const heaviest = particle_get(&p->all, p->index ? p->index[best] : best);
    report_joints(&s, mean.f[F_STATURE], out);
    report_sd(&s, mean.f[F_STATURE], out);
    out->mean = particle_to_state(layout, &mean);
    out->best = particle_to_state(layout, &heaviest);
    gait_state posed = out->mean;
    if (t->layout.plain_root)
        posed.stride_hz = 0.0f; /* in paper mode the gait does not depend on its rate */
    if (model_pose_state(t->model, &posed, &pose) == GAIT_OK)
        memcpy(out->pose.angle, pose.angle, sizeof pose.angle);
    out->phase_r = resultant_length(s.phase);
    out->hypothesis_weight = (float)s.weight;
    out->speed = particle_speed(layout, &mean);
    report_classes(p, motion_class, out);
    return mean;
}

particle_state estimate_particles(const gait_tracker *t, int32_t best, gait_estimate *out)
{
    weighted_particles const p = {.all = t->particles,
                                  .n = t->particles.n,
                                  .weight = t->filter.weight,
                                  .strata = t->classes ? tracker_strata(t) : NULL};
    return estimate_weighted(t, &p, best, out);
}
