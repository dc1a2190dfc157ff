#include "tracker/tracker.h"
#include "likelihood/likelihood.h"
#include "tracker/estimate.h"
#include "base/fmath.h"
#include "tracker/features_step.h"
#include "tracker/track_loss.h"
#include "filter/rejuvenation.h"
#include "tracker/hypotheses.h"
#include "tracker/likelihood_step.h"
#include <string.h>

/* Texture samples are kept where a term compares them with those of the ancestor or the template. */
static bool wants_texture(const gait_tracker_config *cfg)
{
    return (cfg->terms & (GAIT_TERM_TEXTURE | GAIT_TERM_TEMPLATE)) != 0;
}

/* The mutable state first and in one stretch: saving, restoring and hashing copy it whole. */
static void layout_state(arena *a, gait_tracker *t)
{
    int32_t const n = t->cfg.particles, cameras = t->cfg.cameras;
    size_t const samples = (size_t)t->model->limbs * LIKE_SAMPLES;
    t->core = TAKE(a, tracker_core, 1);
    t->filter = pf_layout(a, n);
    if (wants_texture(&t->cfg))
        t->texture = TAKE(a, like_patch, (size_t)n * (size_t)(cameras * t->model->limbs));
    for (int32_t c = 0; c < 2 * cameras && wants_texture(&t->cfg); c++)
        t->template[c / cameras][c % cameras] = TAKE(a, int16_t, samples);
    fixed_lag_layout_state(&t->past, a, t->cfg.lag, n, state_layout_fields(&t->rule));
    t->state_end = TAKE(a, unsigned char, 1);
}

/* The joints take the place of the planes that a frame's features were made from, and these that of the rows in which
 * particles mingle. */
static void layout_shared(arena *a, gait_tracker *t)
{
    arena size = {.cap = SIZE_MAX, .solid = true};
    features_scratch_layout(&size);
    int32_t const floats = i_max(3 * t->model->points, rejuvenation_stride(state_layout_fields(&t->rule)));
    size_t const all = (size_t)floats * (size_t)t->cfg.particles * sizeof *t->joint;
    size_t const bytes = all > size.used ? all : size.used;
    t->joint = (float *)(void *)TAKE(a, unsigned char, bytes);
    arena planes = {.base = (unsigned char *)t->joint, .cap = bytes, .solid = true};
    t->scratch = features_scratch_layout(&planes);
}

/* Without threads there is but one task.  The lagged estimate uses the first one's scratch; what it needs besides takes
 * the place of the others'. */
static void layout_tasks(arena *a, gait_tracker *t)
{
    int32_t const tasks = t->cfg.exec.run ? t->cfg.tasks : 1;
    arena past = {.cap = SIZE_MAX, .solid = true}, others = past;
    fixed_lag_layout_work(&t->past, &past);
    for (int32_t k = 1; k < tasks; k++)
        likelihood_scratch_layout(&others, t->model, NULL);
    t->work = TAKE(a, likelihood_scratch, tasks);
    likelihood_scratch_layout(a, t->model, t->work);
    size_t const bytes = past.used > others.used ? past.used : others.used;
    past = others = (arena){.base = TAKE(a, unsigned char, bytes), .cap = bytes, .solid = true};
    fixed_lag_layout_work(&t->past, &past);
    for (int32_t k = 1; k < tasks; k++)
        likelihood_scratch_layout(&others, t->model, t->work ? t->work + k : NULL);
}

static void layout_work(arena *a, gait_tracker *t)
{
    int32_t const n = t->cfg.particles;
    size_t const limbs = (size_t)t->model->limbs;
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        t->camera[c].features = features_layout(a);
        if (t->cfg.terms & GAIT_TERM_SILHOUETTE)
            t->camera[c].plate = view_planes_layout(a, 3);
    }
    t->like = TAKE(a, like_setup, 1);
    t->loglik_raw = TAKE(a, float, n);
    t->loglik = TAKE(a, float, n);
    t->loglik_without_silhouette = TAKE(a, float, n);
    layout_shared(a, t);
    t->mirror = TAKE(a, mirror, 1);
    t->mode = TAKE(a, uint8_t, n);
    if (wants_texture(&t->cfg))
        t->estimate_patch = TAKE(a, like_patch, (size_t)t->cfg.cameras * limbs);
    for (int32_t c = 0; c < 2 * t->cfg.cameras && wants_texture(&t->cfg); c++)
        t->known[c / t->cfg.cameras][c % t->cfg.cameras] = TAKE(a, int8_t, LIKE_RING *limbs);
    layout_tasks(a, t);
}

/* Two sides need twice the particles of one, and so does a phase that is open. */
static int32_t acquisition_count(const gait_tracker *t)
{
    int32_t const twice = t->wanted > INT32_MAX / 2 ? t->wanted : 2 * t->wanted;
    return i_max(t->wanted, i_min(twice, t->cfg.acquisition_particles));
}

int32_t tracker_count(const gait_tracker *t)
{
    return t->core->hypotheses.stage == HYPOTHESES_ACQUISITION ? acquisition_count(t) : t->wanted;
}

gait_tracker *tracker_layout(arena *a, const gait_model *m, const gait_tracker_config *cfg,
                             const kernels *run)
{
    gait_tracker *const self = TAKE(a, gait_tracker, 1);
    gait_tracker t = {.model = m, .cfg = *cfg, .most = cfg->particles, .wanted = cfg->particles};
    t.cfg.particles = t.room = acquisition_count(&t);
    t.rule = state_layout_init(m, &t.cfg, run);
    t.cfg.components = t.rule.components;
    t.cfg.proportions = t.rule.proportions;
    a->solid = true;
    layout_state(a, &t);
    a->solid = false;
    layout_work(a, &t);
    if (!self || a->overflow)
        return NULL;
    like_setup_init(t.like, m, &t.cfg, run);
    mirror_init(t.mirror, &t.rule);
    *self = t;
    return self;
}

void tracker_set_count(gait_tracker *t, int32_t particles)
{
    t->cfg.particles = t->filter.n = particles;
    t->past.count[t->core->current] = particles;
    t->particles = fixed_lag_particles(&t->past, t->core->current);
    t->core->fewer = t->room - particles;
}

void tracker_want(gait_tracker *t, int32_t particles)
{
    t->wanted = particles;
    t->core->less = t->most - particles;
}

static void even_weights(gait_tracker *t)
{
    pf_uniform(&t->filter);
    pf_keep(&t->filter);
    t->core->ess = (double)t->cfg.particles;
}

void tracker_clear(gait_tracker *t)
{
    memset(t->core, 0, (size_t)(t->state_end - (unsigned char *)t->core));
    tracker_want(t, t->wanted);
    tracker_set_count(t, t->wanted);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        t->camera[c].plate_stale = true;
        for (int32_t side = 0; side < 2 && t->template[side][c]; side++)
            template_clear(t->template[side][c], t->model->limbs);
    }
    even_weights(t);
}

dynamics tracker_dynamics(const gait_tracker *t)
{
    return (dynamics){
        .cfg = &t->cfg, .rule = t->rule, .seed = t->cfg.seed, .stature_sd_ratio = t->core->stature_sd_ratio};
}

/* Standard deviation of the phase below which a start says which leg is which, strides. */
static const float PHASE_KNOWN = 0.2f;

void tracker_start(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime)
{
    tracker_clear(t);
    t->core->started = 1;
    t->core->stature_sd_ratio = sd->stature / f_max(mean->stature, LEAST_STATURE);
    t->core->utime = t->core->start_utime = t->core->support_utime = t->core->rejuvenation_utime = utime;
    if (sd->phase < PHASE_KNOWN)
        hypotheses_settle(t);
    else
        hypotheses_acquire(t);
    tracker_set_count(t, tracker_count(t));
    even_weights(t);
    t->core->last = particle_from_state(&t->rule, mean);
    t->core->phase = mean->phase;
    t->core->rate = mean->stride_hz;
    dynamics const d = tracker_dynamics(t);
    for (int32_t i = 0; i < t->cfg.particles; i++) {
        particle_state const w = dynamics_draw(&d, mean, sd, i);
        particle_put(&t->particles, i, &w);
    }
}

static float seconds_since(const gait_tracker *t, int64_t utime)
{
    return 1e-6f * (float)(t->core->utime - utime);
}

/* Every particle's surface samples become its ancestor's, if there are any of the previous frame. */
static void inherit(gait_tracker *t)
{
    int32_t const before = t->past.count[fixed_lag_slot(&t->past, t->core->current, 1)];
    if (t->core->textured)
        pf_inherit(&t->filter, before, t->texture,
                   (size_t)(t->cfg.cameras * t->like->limbs) * sizeof *t->texture);
}

typedef struct move_job {
    gait_tracker *t;
    particle_set from;
    rejuvenation rejuvenation;
    dynamics_step step;
    int32_t first; /* items before the particles: BLOCK if they inherit meanwhile, else 0 */
} move_job;

static void rows_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const move_job *const j = ctx;
    (void)task;
    for (int32_t i = begin; i < end; i += BLOCK)
        rejuvenation_rows(&j->from, i, i_min(i + BLOCK, end), j->t->joint);
}

static void move_block(const move_job *j, int32_t begin, int32_t lanes)
{
    const gait_tracker *const t = j->t;
    particle_set to = t->particles;
    particle_block then, now;
    if (j->rejuvenation.shrink > 0.0f)
        rejuvenate_block(&j->rejuvenation, begin, lanes, &then);
    else
        particle_block_get(&j->from, t->filter.parent + begin, lanes, &then);
    if (j->step.dt > 0.0f)
        t->like->run->dynamics_move(&j->step, begin, &then, &now);
    particle_block_put(&to, begin, lanes, j->step.dt > 0.0f ? &now : &then);
}

static void move_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const move_job *const j = ctx;
    (void)task;
    for (int32_t i = begin; i < end; i += BLOCK)
        if (i < j->first)
            inherit(j->t);
        else
            move_block(j, i - j->first, i_min(BLOCK, end - i));
}

/* Particles mingle where they were drawn by weight, each with those of its mode; between two modes there is nobody. */
static rejuvenation rejuvenation_after(gait_tracker *t, bool resampled, uint32_t frame)
{
    bool const known_mode = t->core->hypotheses.stage != HYPOTHESES_ACQUISITION && !track_loss_is_lost(t);
    rejuvenation m = {.fields = t->particles.fields,
                      .row = t->joint,
                      .parent = t->filter.parent,
                      .n = t->filter.n,
                      .split = hypotheses_boundary(t),
                      .seed = t->cfg.seed,
                      .frame = frame};
    if (known_mode && resampled)
        rejuvenation_set(&m, seconds_since(t, t->core->rejuvenation_utime), t->cfg.rejuvenation_time);
    if (!known_mode || resampled)
        t->core->rejuvenation_utime = t->core->utime;
    return m;
}

/* Will the particles still be children of those ancestors when the frame is looked at?  Not if they become two sides, or
 * some are drawn anew. */
static bool ancestors_stay(const gait_tracker *t)
{
    return t->core->hypotheses.stage != HYPOTHESES_ACQUISITION && !track_loss_is_lost(t);
}

/* Move every particle from its ancestor into the next generation, which becomes the current one. */
static void predict(gait_tracker *t, float dt, bool resampled, bool stay, uint32_t frame)
{
    dynamics const d = tracker_dynamics(t);
    move_job j = {.t = t, .from = t->particles};
    j.rejuvenation = rejuvenation_after(t, resampled, frame);
    if (j.rejuvenation.shrink > 0.0f)
        task_run(&t->cfg.exec, t->cfg.tasks, j.from.n, BLOCK, rows_range, &j);
    j.step = dynamics_step_init(&d, dt, hypotheses_settled_time(t), frame);
    t->core->current = (t->core->current + 1) % t->past.depth;
    tracker_set_count(t, t->filter.n);
    j.first = stay ? BLOCK : 0;
    task_run(&t->cfg.exec, t->cfg.tasks, j.first + t->cfg.particles, BLOCK, move_range, &j);
}

/* Does the reported phase follow from the one before? */
static bool phase_jumps(const gait_tracker *t, float dt, const gait_estimate *e)
{
    float const jump = 0.2f, expected = t->core->phase + dt * t->core->rate; /* strides */
    return fabsf(m_wrap_pi(TWO_PI_F * (e->mean.phase - expected))) > TWO_PI_F * jump;
}

static int32_t judge(const gait_tracker *t, float dt, bool degenerate, const gait_estimate *e)
{
    float const acquire = 1.0f; /* seconds */
    if (degenerate || track_loss_is_lost(t))
        return GAIT_TRACK_LOST;
    if (hypotheses_acquiring(t) || !t->core->met)
        return GAIT_TRACK_INIT;
    if (e->hypothesis_weight < 0.7f)
        return seconds_since(t, t->core->start_utime) < acquire ? GAIT_TRACK_INIT : GAIT_TRACK_AMBIGUOUS;
    bool const open = hypotheses_open(t) || track_loss_doubts_front(t) || phase_jumps(t, dt, e);
    return open ? GAIT_TRACK_AMBIGUOUS : GAIT_TRACK_TRACKING;
}

/* Which cameras saw this frame, as bits. */
static uint32_t seeing(const gait_tracker *t)
{
    uint32_t mask = 0;
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        mask |= (uint32_t)t->camera[c].features.has_image << c;
    return mask;
}

static void remember_appearance(gait_tracker *t)
{
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        if (t->camera[c].features.has_image && t->template[0][c])
            template_update(t->template[0][c], t->model->limbs, t->estimate_patch + c * t->model->limbs);
}

/* Weigh the particles by the frame and fill in the estimate. */
static void observe(gait_tracker *t, float dt, gait_estimate *out)
{
    likelihood_step(t);
    track_loss_allow_hidden(t);
    pf_summary const s = hypotheses_update(t, dt);
    t->core->ess = s.ess;
    t->core->textured = wants_texture(&t->cfg) ? seeing(t) : 0;
    out->log_evidence = s.log_evidence;
    out->flags |= s.degenerate || s.ess < 2.0 ? GAIT_EST_DEGENERATE : 0;
    particle_state const mean = estimate_fill(t, s.best, out);
    track_loss_update(t, &mean);
    out->status = judge(t, dt, s.degenerate, out);
    if (out->status == GAIT_TRACK_TRACKING && t->core->hypotheses.stage == HYPOTHESES_ONE && !t->core->part)
        remember_appearance(t);
}

/* No camera saw anything: the prediction is the estimate. */
static void coast(gait_tracker *t, float dt, gait_estimate *out)
{
    likelihood_step(t);                /* no camera: only the joints */
    t->core->ess = pf_ess(&t->filter); /* resampled weights are even */
    t->core->textured = 0;
    estimate_fill(t, pf_heaviest(&t->filter), out);
    out->flags |= GAIT_EST_NO_IMAGE;
    out->status = judge(t, dt, false, out);
}

gait_result tracker_step(gait_tracker *t, const gait_frame *frame, gait_estimate *out)
{
    tracker_core *const core = t->core;
    float const dt = 1e-6f * (float)(frame->utime - core->utime);
    gait_estimate e = {.utime = frame->utime, .frame = core->frame};
    uint32_t const counter = (uint32_t)core->frame;
    core->utime = frame->utime;
    if (track_loss_is_lost(t))
        core->ess = 0.0; /* particles drawn anew weigh what others do */
    bool const resampled = core->frame > 0 && hypotheses_resample(t, counter);
    bool const stay = ancestors_stay(t);
    predict(t, dt, resampled, stay, counter);
    hypotheses_split(t);
    track_loss_search(t, counter);
    if (!stay)
        inherit(t);
    particle_state const place = particle_set_place(&t->particles, t->filter.weight);
    if (features_step(t, frame, &place) > 0)
        observe(t, dt, &e);
    else
        coast(t, dt, &e);
    e.flags |= resampled ? GAIT_EST_RESAMPLED : 0;
    e.ess = (float)core->ess;
    fixed_lag_keep(t, &e);
    core->phase = e.mean.phase;
    core->rate = e.mean.stride_hz;
    core->frame++;
    *out = e;
    return GAIT_OK;
}
