#include "tracker/tracker.h"
#include "base/fmath.h"
#include "filter/rejuvenation.h"
#include "image/camera.h"
#include "tracker/class_strata.h"
#include "tracker/estimate.h"
#include "tracker/features_step.h"
#include "tracker/fit_check.h"
#include "tracker/fixed_lag.h"
#include "tracker/front_back.h"
#include "tracker/hypotheses.h"
#include "tracker/left_right.h"
#include "tracker/likelihood_step.h"
#include "tracker/pose_error.h"
#include "tracker/track_loss.h"
#include "tracker/walk_check.h"

static const float KNOWN_PHASE_SD = 0.2f; /* strides: a start with less determines which leg is which */
static const float SETTLE_TIME = 1.0f;    /* seconds after a start in which none may be dominant yet */
static const float PHASE_DEPARTURE =
    0.2f; /* strides from the predicted phase above which a track is ambiguous */
static const double DEGENERATE_ESS = 2.0;
static const float IMPROBABLE =
    0.01f; /* hypotheses are left out below this share of the first one's probability */
static const float OTHER_CLASS = 0.1f; /* probability at a start that is divided equally among all classes */
static const float BESIDE =
    0.25f; /* statures by which competing hypotheses may be side by side in an image */

/* Whether hypothesis h competes with the first one: it is not improbable, both walk on the floor or both on a belt, and
 * in every image they overlap, so that the same region shows either. */
static bool competes(const gait_tracker *t, const gait_hypothesis *first, const gait_hypothesis *h)
{
    bool same = h->probability > IMPROBABLE * first->probability && h->in_place == first->in_place;
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        float a[3], b[3];
        camera_to(&t->cfg.camera[c], first->mean.pelvis, a);
        camera_to(&t->cfg.camera[c], h->mean.pelvis, b);
        float const beside = a[0] * b[1] - a[1] * b[0], apart = BESIDE * h->mean.stature;
        same &= beside * beside <= apart * apart * (a[0] * a[0] + a[1] * a[1]);
    }
    return same;
}

/* A state of another class that appears much the same.  From forwards to backwards the person turns round, with the other
 * leg ahead; but not where no image distinguishes front and back, since nearly all people walk forwards. */
static gait_state as_class(const gait_tracker *t, const gait_state *s, int32_t motion_class)
{
    gait_state to = *s;
    const gait_model *const was = t->layouts[s->motion_class].model, *const is =
                                                                         t->layouts[motion_class].model;
    particle_state const p = particle_from_state(&t->layouts[s->motion_class], s);
    if (was->direction * is->direction < 0 && front_back_visible(t, &p)) {
        to.heading = m_wrap_pi_one(s->heading + PI_F);
        to.phase = m_wrap1(0.5f - s->phase);
    }
    to.motion_class = motion_class;
    return to;
}

/* Draw particles first .. end - 1, of one class, from the n hypotheses by probability. */
static void draw_range(gait_tracker *t, const gait_hypothesis *const *from, int32_t n, float total,
                       int32_t motion_class, int32_t first, int32_t end)
{
    dynamics const d = tracker_dynamics(t, motion_class);
    float drawn = 0.0f; /* probability */
    float root[DYNAMICS_CORRELATED][DYNAMICS_CORRELATED];
    for (int32_t i = first, k = -1; i < end; i++) {
        while (k + 1 < n && (k < 0 || ((float)(i - first) + 0.5f) * total > drawn * (float)(end - first))) {
            drawn += from[++k]->probability;
            dynamics_root(from[k]->correlation, root);
        }
        bool const same = from[k]->mean.motion_class == motion_class;
        gait_state const mean = as_class(t, &from[k]->mean, motion_class);
        particle_state const p = dynamics_draw(&d, &mean, &from[k]->sd,
                                               same ? (const float (*)[DYNAMICS_CORRELATED])root : NULL, i);
        particle_put(&t->particles, i, &p);
    }
}

/* Every class is possible at a start, most of all those of the hypotheses. */
static void draw_classes(gait_tracker *t, const gait_hypothesis *const *from, int32_t n, float total)
{
    int32_t const classes = t->model->classes;
    double probability[GAIT_MAX_CLASSES] = {0.0};
    for (int32_t c = 0; c < classes; c++)
        probability[c] = (double)OTHER_CLASS / (double)classes;
    for (int32_t k = 0; k < n; k++)
        probability[from[k]->mean.motion_class] +=
            (double)((1.0f - OTHER_CLASS) * from[k]->probability / total);
    class_strata_begin(t, probability);
    const strata *const s = tracker_strata(t);
    for (int32_t k = 0; k < s->count; k++)
        draw_range(t, from, n, total, s->motion_class[k], s->first[k], s->first[k + 1]);
    class_state *const state = t->classes;
    state->reported = state->supported = state->moved_class = from[0]->mean.motion_class;
}

void tracker_start(gait_tracker *t, const gait_hypothesis *h, int32_t count, bool sure, int64_t utime)
{
    tracker_core *const core = t->core;
    const gait_hypothesis *from[GAIT_START_MAX_HYPOTHESES];
    int32_t n = 0;
    float total = 0.0f; /* probability */
    bool known = true;
    for (int32_t k = 0; k < count; k++)
        if (k == 0 || competes(t, h, &h[k])) {
            from[n++] = &h[k];
            total += h[k].probability;
            known &= h[k].sd.phase < KNOWN_PHASE_SD;
        }
    tracker_clear(t);
    core->started = 1;
    core->stature_sd_ratio = h->sd.stature / f_max(h->mean.stature, LEAST_STATURE);
    core->utime = core->start_utime = core->support_utime = core->rejuvenation_utime = utime;
    if (!sure)
        hypotheses_require_proof(t);
    if (!known)
        hypotheses_acquire(t);
    else if (!sure)
        hypotheses_compare(t);
    else
        hypotheses_settle(t);
    tracker_set_count(t, tracker_count(t));
    tracker_even_weights(t);
    core->last_supported = particle_from_state(&t->layouts[h->mean.motion_class], &h->mean);
    core->reported_phase = h->mean.phase;
    core->reported_rate = h->mean.stride_hz * (float)t->layouts[h->mean.motion_class].model->direction;
    if (t->classes)
        draw_classes(t, from, n, total);
    else
        draw_range(t, from, n, total, 0, 0, t->cfg.particles);
}

/* ---- rejuvenate and predict ---- */
typedef struct move_job {
    gait_tracker *t;
    particle_set from; /* the generation before */
    rejuvenation rejuvenation;
    uint32_t counter; /* of the random numbers */
    dynamics_step step[GAIT_MAX_CLASSES];
} move_job;

/* Particles are rejuvenated after resampling, within their hypothesis.  Not during acquisition or while the person is lost:
 * a mean of particles in two places is in neither. */
static rejuvenation rejuvenation_of(const gait_tracker *t, bool resampled, bool hypotheses_known,
                                    uint32_t counter)
{
    rejuvenation r = {.fields = t->particles.fields,
                      .row = t->rows,
                      .parent = t->filter.parent,
                      .n = t->filter.n,
                      .split = hypotheses_boundary(t),
                      .origin = t->classes ? t->origin : NULL,
                      .seed = t->cfg.seed,
                      .frame = counter};
    if (hypotheses_known && resampled)
        rejuvenation_set(&r, seconds_since(t, t->core->rejuvenation_utime), t->cfg.rejuvenation_time);
    return r;
}

static void rows_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const move_job *const j = ctx;
    (void)task;
    for (int32_t i = begin; i < end; i += BLOCK)
        rejuvenation_rows(&j->from, i, i_min(i + BLOCK, end), j->t->rows);
}

static void move_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const move_job *const j = ctx;
    const gait_tracker *const t = j->t;
    particle_set to = t->particles;
    rejuvenation r = j->rejuvenation;
    (void)task;
    for (int32_t i = begin; i < end; i += BLOCK) {
        int32_t const lanes = i_min(BLOCK, end - i);
        const dynamics_step *const step = &j->step[class_at(t, i)];
        particle_block then, now;
        if (t->classes) {
            int32_t const k = stratum_at(tracker_strata(t), i);
            r.begin = tracker_strata(t)->first[k];
            r.n = tracker_strata(t)->first[k + 1];
            r.motion_class = tracker_strata(t)->motion_class[k];
        }
        if (r.shrink > 0.0f)
            rejuvenate_block(&r, i, lanes, &then);
        else
            particle_block_get(&j->from, t->filter.parent + i, lanes, &then);
        if (t->classes)
            class_strata_enter(t, j->counter, step->dt, i, lanes, &then);
        if (step->dt != 0.0f)
            t->like->run->dynamics_move(step, i, &then, &now);
        particle_block_put(&to, i, lanes, step->dt != 0.0f ? &now : &then);
    }
}

/* Every particle's surface samples become those of its ancestor. */
static void inherit_texture(void *ctx)
{
    const move_job *const j = ctx;
    gait_tracker *const t = j->t;
    pf_inherit(&t->filter, j->from.n, t->texture,
               (size_t)(t->cfg.cameras * t->like->limbs) * sizeof *t->texture);
}

/* Move every particle from its ancestor into the next generation, which becomes the current one. */
static void predict(gait_tracker *t, float dt, const rejuvenation *r, uint32_t counter)
{
    move_job j = {.t = t, .from = t->particles, .rejuvenation = *r, .counter = counter};
    if (r->shrink > 0.0f)
        task_run(&t->cfg.exec, t->cfg.tasks, j.from.n, BLOCK, rows_range, &j);
    else if (t->history.depth == 1) { /* the next generation replaces this one */
        memcpy(t->rows, j.from.value, (size_t)(j.from.n * j.from.fields) * sizeof *t->rows);
        j.from.value = t->rows;
    }
    for (int32_t c = 0; c < t->model->classes; c++) {
        dynamics const d = tracker_dynamics(t, c);
        j.step[c] = dynamics_step_init(&d, dt, hypotheses_settled_time(t), counter);
    }
    if (t->classes)
        class_strata_origins(t, tracker_strata(t));
    t->core->generation = (t->core->generation + 1) % t->history.depth;
    tracker_set_count(t, t->filter.n);
    if (t->classes)
        *tracker_strata(t) = *t->next;
    task_run_beside(&t->cfg.exec, t->cfg.tasks, t->core->sampled_cameras ? inherit_texture : NULL,
                    t->cfg.particles, BLOCK, move_range, &j);
}

/* Move the states that are of one class. */
static void predict_class(const gait_tracker *t, gait_state *s, int32_t n, float dt, int32_t motion_class)
{
    dynamics d = tracker_dynamics(t, motion_class);
    d.seed = ~d.seed;
    dynamics_step const step =
        dynamics_step_init(&d, dt, hypotheses_settled_time(t), (uint32_t)t->core->frame);
    for (int32_t first = 0; first < n; first += BLOCK) {
        int32_t const lanes = i_min(BLOCK, n - first);
        bool any = false;
        particle_block from = {0}, to;
        particle_set then = {.n = BLOCK, .fields = step.fields, .value = from.f[0]};
        particle_set const now = {.n = BLOCK, .fields = step.fields, .value = to.f[0]};
        for (int32_t lane = 0; lane < lanes; lane++) {
            if (s[first + lane].motion_class != motion_class)
                continue;
            particle_state const p = particle_from_state(&d.rule, &s[first + lane]);
            particle_put(&then, lane, &p);
            any = true;
        }
        if (any)
            t->like->run->dynamics_move(&step, first, &from, &to);
        for (int32_t lane = 0; any && lane < lanes; lane++) {
            particle_state const p = particle_get(&now, lane);
            if (s[first + lane].motion_class == motion_class)
                s[first + lane] = particle_to_state(&d.rule, &p);
        }
    }
}

void tracker_predict(const gait_tracker *t, gait_state *s, int32_t n, float dt)
{
    for (int32_t c = 0; c < t->model->classes && dt > 0.0f; c++)
        predict_class(t, s, n, dt, c);
}

/* ---- after the estimate ---- */
/* Cameras with an image in this frame, as bits. */
static uint32_t cameras_seeing(const gait_tracker *t)
{
    uint32_t mask = 0;
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        mask |= (uint32_t)t->camera[c].features.has_image << c;
    return mask;
}

/* Record whether the frame supports the estimate.  When the person is found again, left and right are open unless the
 * phase is as predicted. */
static void check_estimate(gait_tracker *t, float dt, bool lost, const state_layout *of,
                           const particle_state *mean)
{
    tracker_core *const core = t->core;
    hypotheses_state *const h = &core->hypotheses;
    track_loss_verdict const v = track_loss_check(t, lost, of, mean);
    core->partly_hidden = v.support == SUPPORT_PART;
    core->usual_unexplained = v.usual_unexplained;
    bool const proven = core->found || hypotheses_prove(t, dt, v.by_images);
    if (v.support == SUPPORT_NONE) {
        if (lost && (h->stage != HYPOTHESES_TWO || v.phase_expired))
            hypotheses_drop(t);
        return;
    }
    bool const left_right = h->left_right_known || h->stage == HYPOTHESES_TWO;
    if (lost && !(left_right && v.phase_as_predicted))
        hypotheses_acquire(t);
    core->front_back_margin = front_back_update(t, lost || !core->found, of, mean);
    core->left_right_margin = left_right_update(t, lost || !core->found || hypotheses_open(t), dt, of, mean);
    core->fit_margin = fit_check_update(t, lost || !core->found, of, mean);
    if (t->classes)
        class_strata_support(t, of->model->motion_class, mean);
    core->support_utime = core->utime;
    core->last_supported = *mean;
    core->found = proven;
}

/* Whether the checks find that a different body fits as well.  A standing person has no left and right step. */
static bool others_fit(const gait_tracker *t, const gait_estimate *e)
{
    const tracker_core *const core = t->core;
    bool const still = class_stands(t, e->motion_class);
    return core->fit_margin < 0.0f || core->front_back_margin < 0.0f ||
           (!still && core->left_right_margin < 0.0f);
}

static gait_track_status status_of(const gait_tracker *t, float dt, const gait_estimate *e)
{
    const tracker_core *const core = t->core;
    bool const still = class_stands(t, e->motion_class);
    float const predicted = core->reported_phase + in_walking_time(t, dt) * core->reported_rate;
    bool const departs =
        !(t->classes && (e->motion_class != t->classes->reported || still)) &&
        fabsf(m_wrap_pi_one(TWO_PI_F * (e->mean.phase - predicted))) > TWO_PI_F * PHASE_DEPARTURE;
    if (track_loss_is_lost(t))
        return GAIT_TRACK_LOST;
    if (hypotheses_acquiring(t) || !core->found)
        return GAIT_TRACK_INIT;
    if (e->hypothesis_weight < DOMINANT_WEIGHT)
        return seconds_since(t, core->start_utime) < SETTLE_TIME ? GAIT_TRACK_INIT : GAIT_TRACK_AMBIGUOUS;
    bool const open = (!still && hypotheses_open(t)) || others_fit(t, e) || departs;
    return open ? GAIT_TRACK_AMBIGUOUS : GAIT_TRACK_TRACKING;
}

static void learn_appearance(gait_tracker *t)
{
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        if (t->camera[c].features.has_image && t->template[0][c])
            template_update(t->template[0][c], t->model->limbs, t->estimate_patch + c * t->model->limbs);
}

/* ---- the step ---- */
void tracker_step(gait_tracker *t, const gait_frame *frame, gait_estimate *out)
{
    tracker_core *const core = t->core;
    hypotheses_state *const h = &core->hypotheses;
    float const dt = 1e-6f * (float)(frame->utime - core->utime);
    uint32_t const counter = (uint32_t)core->frame; /* of the random numbers */
    gait_estimate e = {.utime = frame->utime, .frame = core->frame};
    core->utime = frame->utime;
    bool const lost = track_loss_is_lost(t);

    /* Resample. */
    if (hypotheses_decided(t))
        hypotheses_merge(t);
    if (lost)
        core->ess = 0.0; /* forces resampling: redrawn particles have less weight than the others */
    bool const resampled = core->frame > 0 && hypotheses_resample(t, counter);

    /* Rejuvenate and predict.  Particles that are split or redrawn have no samples of their ancestors' surface. */
    bool const hypotheses_known = h->stage != HYPOTHESES_ACQUISITION && !lost;
    bool const split = hypotheses_acquired(t);
    /* Nothing is redrawn while there are two hypotheses, and never in the paper's filter. */
    bool const redraw = lost && h->stage != HYPOTHESES_TWO && !split && t->cfg.mode != GAIT_MODE_PAPER;
    if (split || redraw)
        core->sampled_cameras = 0;
    rejuvenation const r = rejuvenation_of(t, resampled, hypotheses_known, counter);
    if (resampled || !hypotheses_known)
        core->rejuvenation_utime = core->utime;
    predict(t, dt, &r, counter);
    if (split)
        hypotheses_split(t);
    if (redraw)
        track_loss_redraw(t, counter);

    /* Features, likelihood and weights. */
    particle_state const place = particle_set_place(&t->particles, t->filter.weight);
    bool const has_image = features_step(t, frame, &place) > 0;
    pose_error_correct(t);
    likelihood_step(t); /* without an image it only computes joints */
    if (has_image)
        track_loss_bound(t);
    if (has_image && t->classes)
        class_strata_penalise_drift(t);
    pf_summary s = has_image ? hypotheses_update(t, dt)
                             : (pf_summary){.best = pf_heaviest(&t->filter), .ess = pf_ess(&t->filter)};
    if (t->classes)
        (void)class_strata_best(tracker_strata(t), t->filter.weight, &s.best);
    core->ess = s.ess;
    core->sampled_cameras = uses_texture(&t->cfg) ? cameras_seeing(t) : 0;

    /* Estimate and track loss. */
    particle_state const mean = estimate_particles(t, s.best, &e);
    if (has_image) {
        walk_check_update(t, &mean);
        check_estimate(t, dt, lost, &t->layouts[e.motion_class], &mean);
    }
    hypotheses_record_agreement(t, e.hypothesis_weight);
    bool const few = s.degenerate || s.ess < DEGENERATE_ESS; /* particles with weight */
    e.status = s.degenerate ? GAIT_TRACK_LOST : status_of(t, dt, &e);
    e.flags = (resampled ? GAIT_EST_RESAMPLED : 0) | (has_image ? 0 : GAIT_EST_NO_IMAGE) |
              (has_image && few ? GAIT_EST_DEGENERATE : 0) |
              (has_image && core->support_utime != core->utime ? GAIT_EST_UNSUPPORTED : 0) |
              (others_fit(t, &e) ? GAIT_EST_OTHERS_FIT : 0);
    e.ess = (float)s.ess;
    e.log_evidence = s.log_evidence;
    if (e.status == GAIT_TRACK_TRACKING && h->stage == HYPOTHESES_ONE && !core->partly_hidden)
        learn_appearance(t);

    if (t->classes)
        class_strata_report(t, &mean, &e);
    fixed_lag_record(t, &e);
    core->reported_phase = e.mean.phase;
    core->reported_rate = e.mean.stride_hz * (float)t->layouts[e.motion_class].model->direction;
    core->frame++;
    *out = e;
}
