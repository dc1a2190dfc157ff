#include "tracker/hypotheses.h"
#include "base/fmath.h"
#include "base/rng.h"
#include "filter/evidence.h"
#include "image/camera.h"
#include "tracker/class_strata.h"
#include <string.h>

static const float ACQUISITION_TIME = 0.5f; /* seconds until the phase is known modulo half a stride */
/* Seconds in which both hypotheses adapt to the images before evidence counts. */
static const float REFIT_TIME = 0.4f;
static const float AGREED = 0.9f; /* weight of the dominant hypothesis from which those of a start agree */
static const float JITTER_SCORE = 0.5f, JITTER_HEADING = 0.1f, JITTER_RATE = 0.02f,
                   JITTER_PHASE = 0.05f;  /* sd */
static const double MERGE_LOG_ODDS = 9.0; /* from which the other hypothesis is dropped */
/* Effective sample size that remains after each frame of acquisition, as a share of the particles: with known phase, and
 * without, where particles that agree on a body too soon leave left and right to chance. */
static const double KNOWN_ESS = 0.2, UNKNOWN_ESS = 0.4;
/* Initial log odds against the person of an automatic start (probability 0.95), until images show one. */
static const double PROOF = 3.0;

/* ---- stages ---- */
static float seconds_in_stage(const gait_tracker *t)
{
    return seconds_since(t, t->core->hypotheses.since);
}

static void enter(gait_tracker *t, int32_t stage)
{
    t->core->hypotheses = (hypotheses_state){.stage = stage,
                                             .since = t->core->utime,
                                             .left_right_known = stage == HYPOTHESES_ONE,
                                             .log_odds = t->core->found ? 0.0 : t->core->hypotheses.log_odds};
}

float hypotheses_evidence_share(const gait_tracker *t, float seconds)
{
    float const time = t->cfg.evidence_time;
    return seconds > 0.0f && seconds < time ? seconds / time : 1.0f;
}

void hypotheses_acquire(gait_tracker *t)
{
    enter(t, t->cfg.mode == GAIT_MODE_PAPER ? HYPOTHESES_ONE : HYPOTHESES_ACQUISITION);
}

void hypotheses_compare(gait_tracker *t)
{
    hypotheses_acquire(t);
    t->core->hypotheses.phase_known = 1;
}

void hypotheses_settle(gait_tracker *t)
{
    enter(t, HYPOTHESES_ONE);
}

void hypotheses_drop(gait_tracker *t)
{
    t->core->hypotheses.stage = HYPOTHESES_ONE;
}

bool hypotheses_decided(const gait_tracker *t)
{
    const hypotheses_state *const h = &t->core->hypotheses;
    return h->stage == HYPOTHESES_TWO && fabs(h->log_odds) > MERGE_LOG_ODDS;
}

void hypotheses_require_proof(gait_tracker *t)
{
    t->core->hypotheses.log_odds = -PROOF;
}

bool hypotheses_prove(gait_tracker *t, float dt, float nats)
{
    hypotheses_state *const h = &t->core->hypotheses;
    double const sum = nats == 0.0f ? 0.0 : h->log_odds + (double)(hypotheses_evidence_share(t, dt) * nats);
    if (h->log_odds < 0.0)
        h->log_odds = sum > 0.0 ? 0.0 : sum < -PROOF ? -PROOF : sum;
    return h->log_odds >= 0.0;
}

void hypotheses_record_agreement(gait_tracker *t, float weight)
{
    hypotheses_state *const h = &t->core->hypotheses;
    h->agreed = h->stage == HYPOTHESES_ACQUISITION && h->phase_known && weight >= AGREED;
}

/* The person is to be found first. */
bool hypotheses_acquired(const gait_tracker *t)
{
    const hypotheses_state *const h = &t->core->hypotheses;
    if (h->stage == HYPOTHESES_ONE)
        return t->classes && t->classes->open_sides;
    return h->stage == HYPOTHESES_ACQUISITION && h->log_odds >= 0.0 &&
           (h->agreed || seconds_in_stage(t) >= ACQUISITION_TIME);
}

bool hypotheses_open(const gait_tracker *t)
{
    const hypotheses_state *const h = &t->core->hypotheses;
    return h->stage == HYPOTHESES_ACQUISITION ||
           (h->stage == HYPOTHESES_TWO && fabs(h->log_odds) < (double)REPORT_LOG_ODDS);
}

bool hypotheses_acquiring(const gait_tracker *t)
{
    int32_t const stage = t->core->hypotheses.stage;
    return stage == HYPOTHESES_ACQUISITION || (stage == HYPOTHESES_TWO && seconds_in_stage(t) < REFIT_TIME);
}

float hypotheses_settled_time(const gait_tracker *t)
{
    return t->core->hypotheses.stage == HYPOTHESES_ONE ? seconds_in_stage(t) : 0.0f;
}

/* ---- the particles of one hypothesis ---- */
/* As a filter of its own. */
static pf filter_of(const pf *f, int32_t hypothesis)
{
    int32_t const first = hypothesis_first(f->n, hypothesis);
    return (pf){.n = hypothesis_first(f->n, hypothesis + 1) - first,
                .log_weight = f->log_weight + first,
                .weight = f->weight + first,
                .parent = f->parent + first,
                .cumulative = f->cumulative + first};
}

/* Log probability of a hypothesis: log of the logistic function of the odds for it. */
static double log_probability(const gait_tracker *t, int32_t hypothesis)
{
    double const odds = hypothesis == 1 ? t->core->hypotheses.log_odds : -t->core->hypotheses.log_odds;
    return odds > 0.0 ? -m_log64(1.0 + m_exp64(-odds)) : odds - m_log64(1.0 + m_exp64(odds));
}

static void scale_weights(pf *f, double log_factor)
{
    double const factor = m_exp64(log_factor);
    for (int32_t i = 0; i < f->n; i++) {
        f->weight[i] *= factor;
        f->log_weight[i] += log_factor;
    }
}

static double total_weight(const pf *f)
{
    double sum = 0.0;
    for (int32_t i = 0; i < f->n; i++)
        sum += f->weight[i];
    return sum;
}

/* Drop the less probable hypothesis: its particles get no weight, and the next resampling replaces them. */
void hypotheses_merge(gait_tracker *t)
{
    int32_t const loser = t->core->hypotheses.log_odds < 0.0;
    pf lost = filter_of(&t->filter, loser), kept = filter_of(&t->filter, 1 - loser);
    for (int32_t i = 0; i < lost.n; i++) {
        lost.weight[i] = 0.0;
        lost.log_weight[i] = -1e300;
    }
    scale_weights(&kept, -log_probability(t, 1 - loser));
    for (int32_t c = 0; c < t->cfg.cameras && t->template[0][c]; c++)
        if (loser == 0)
            memcpy(t->template[0][c], t->template[1][c],
                   (size_t)t->model->limbs * LIKE_SAMPLES * sizeof *t->template[0][c]);
    enter(t, HYPOTHESES_ONE);
    t->core->ess = 0.0;
}

/* ---- resampling ---- */
static bool needs_resampling(const gait_tracker *t, int32_t hypothesis)
{
    pf const f = filter_of(&t->filter, hypothesis);
    double const sum = total_weight(&f);
    return pf_ess(&f) * sum * sum < (double)t->cfg.resample_ess * (double)f.n;
}

static void resample_hypothesis(gait_tracker *t, int32_t hypothesis, uint32_t u)
{
    pf f = filter_of(&t->filter, hypothesis);
    pf_resample_systematic(&f, u);
    for (int32_t i = 0; i < f.n; i++)
        f.parent[i] += hypothesis_first(t->filter.n, hypothesis);
    scale_weights(&f, log_probability(t, hypothesis));
}

static bool resample_all(gait_tracker *t, const uint32_t u, uint32_t counter)
{
    double const least = (double)t->cfg.resample_ess * (double)t->cfg.particles;
    if (t->core->ess >= least && t->cfg.resample_ess < 1.0f && !hypotheses_acquired(t))
        return false;
    if (t->cfg.mode == GAIT_MODE_PAPER)
        pf_resample_multinomial(&t->filter, t->cfg.seed, STREAM_RESAMPLE, counter);
    else
        pf_resample_systematic(&t->filter, u);
    return true;
}

/* Resample as above with several classes of motion. */
static bool resample_classes(gait_tracker *t, const uint32_t u[2])
{
    int32_t const before = t->filter.n, count = tracker_count(t);
    bool const two = t->core->hypotheses.stage == HYPOTHESES_TWO;
    *t->next = *tracker_strata(t);
    if ((two || count == before) && !hypotheses_acquired(t) && !class_strata_due(t))
        return false;
    t->next->count = 0;
    for (int32_t h = 0; h < 1 + two; h++) {
        int32_t const begin = two ? hypothesis_first(before, h) : 0;
        int32_t const end = two ? hypothesis_first(before, h + 1) : before;
        class_strata_resample(t, begin, end, two ? end - begin : count, u[h]);
    }
    t->filter.n = two ? before : count;
    t->classes->resampled = t->core->utime - t->core->start_utime;
    return true;
}

bool hypotheses_resample(gait_tracker *t, uint32_t counter)
{
    uint32_t r[4];
    rng_bits(t->cfg.seed, STREAM_RESAMPLE, counter, 0, 0, r);
    pf_keep(&t->filter);
    if (t->classes)
        return resample_classes(t, r);
    if (t->core->hypotheses.stage != HYPOTHESES_TWO) {
        if (tracker_count(t) == t->filter.n)
            return resample_all(t, r[0], counter);
        pf_resize(&t->filter, tracker_count(t), r[0]);
        return true;
    }
    if (!needs_resampling(t, 0) && !needs_resampling(t, 1))
        return false;
    for (int32_t h = 0; h < 2; h++) /* both, since they are rejuvenated in the same step */
        resample_hypothesis(t, h, r[h]);
    return true;
}

/* ---- split ---- */
/* A person who stands still has no phase. */
static bool still(const gait_tracker *t, int32_t particle)
{
    return layout_at(t, particle)->model->direction == 0;
}

/* Phase modulo half a stride that most particles agree on: the mean of the doubled angle. */
static float half_phase(const gait_tracker *t)
{
    const float *const phase = field(&t->particles, F_PHASE);
    double c = 0.0, s = 0.0;
    for (int32_t i = 0; i < t->particles.n; i++) {
        float sn, cs;
        if (still(t, i))
            continue;
        m_sincos_one(2.0f * TWO_PI_F * phase[i], &sn, &cs);
        c += (double)cs;
        s += (double)sn;
    }
    return 0.5f * m_atan2((float)s, (float)c) / TWO_PI_F;
}

/* Heading reflected at a plane across the first camera's viewing direction, which swaps near and far.  Without perspective
 * the body and its reflection have the same image. */
static float reflected_heading(const gait_tracker *t, const particle_state *p)
{
    float to[3];
    camera_to(&t->cfg.camera[0], p->f + F_X, to);
    return m_wrap_pi_one(2.0f * m_atan2(to[1], to[0]) + PI_F - p->f[F_HEADING]);
}

/* The other reading of the same image.  Every second particle also swaps near and far where that turns the person by less
 * than 90 degrees: viewed from in front, the legs swap places without it. */
static particle_state other_hypothesis(const gait_tracker *t, const particle_state *p, int32_t i)
{
    const state_layout *const of = layout_at(t, i);
    particle_state to = mirror_apply(&t->mirror[of->model->motion_class], of, p);
    float const heading = reflected_heading(t, p);
    if ((i & 1) && fabsf(m_wrap_pi_one(heading - p->f[F_HEADING])) < 0.5f * PI_F)
        to.f[F_HEADING] = heading;
    return to;
}

/* Spread heading, gait and phase, so that a hypothesis finds its own and does not keep those that suited the other. */
static void jitter(const gait_tracker *t, int32_t i, particle_state *p)
{
    float n[4];
    for (int32_t k = 0; k < t->layout.components; k++) {
        if (k % 4 == 0)
            rng_normal4(t->cfg.seed, STREAM_SPLIT, (uint32_t)(k / 4 + 1), (uint32_t)i, 0, n);
        p->f[F_COEF + k] += JITTER_SCORE * n[k % 4];
    }
    rng_normal4(t->cfg.seed, STREAM_SPLIT, 0, (uint32_t)i, 0, n);
    p->f[F_HEADING] = m_wrap_pi_one(p->f[F_HEADING] + JITTER_HEADING * n[0]);
    p->f[F_RATE] *= 1.0f + JITTER_RATE * n[1];
    p->f[F_PHASE] = m_wrap1(p->f[F_PHASE] + JITTER_PHASE * n[2]);
}

/* Deal the particles in turn to both hypotheses: first those with even numbers, then the others. */
static void deal(gait_tracker *t)
{
    pf *const f = &t->filter;
    int32_t const n = f->n, second = hypothesis_first(n, 1);
    float *const before = t->rows;
    for (int32_t k = 0; k < t->particles.fields; k++) {
        float *const now = field(&t->particles, k);
        memcpy(before, now, (size_t)n * sizeof *before);
        for (int32_t i = 0; i < n; i++)
            now[i] = before[i < second ? 2 * i : 2 * (i - second) + 1];
    }
    for (int32_t i = 0; i < n; i++)
        f->cumulative[i] = (uint64_t)f->parent[i];
    for (int32_t i = 0; i < n; i++)
        f->parent[i] = (int32_t)f->cumulative[i < second ? 2 * i : 2 * (i - second) + 1];
}

typedef struct split_job {
    const gait_tracker *t;
    particle_set particles;
    float phase; /* of the first hypothesis */
} split_job;

/* Mirror the particles that are nearer to the hypothesis they were not dealt to. */
static void split_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    split_job *const j = ctx;
    (void)task;
    for (int32_t i = begin; i < end; i++) {
        bool const second = i >= hypothesis_first(j->particles.n, 1);
        particle_state p = particle_get(&j->particles, i);
        bool const far = fabsf(m_wrap_pi_one(TWO_PI_F * (p.f[F_PHASE] - j->phase))) > 0.5f * PI_F;
        if (still(j->t, i))
            continue;
        if (far != second)
            p = other_hypothesis(j->t, &p, i);
        jitter(j->t, i, &p);
        particle_put(&j->particles, i, &p);
    }
}

/* The odds begin even, whatever acquisition favoured. */
void hypotheses_split(gait_tracker *t)
{
    split_job j = {.t = t, .particles = t->particles, .phase = half_phase(t)};
    deal(t);
    enter(t, HYPOTHESES_TWO);
    if (t->classes) {
        class_strata_split(t,
                           (const double[2]){m_exp64(log_probability(t, 0)), m_exp64(log_probability(t, 1))});
        t->classes->open_sides = 0;
    }
    task_run(&t->cfg.exec, t->cfg.tasks, t->filter.n, BLOCK, split_range, &j);
    for (int32_t h = 0; h < 2; h++) {
        pf f = filter_of(&t->filter, h);
        if (!t->classes) {
            pf_uniform(&f);
            scale_weights(&f, log_probability(t, h));
        }
        for (int32_t c = 0; c < t->cfg.cameras && t->template[h][c]; c++)
            template_clear(t->template[h][c], t->model->limbs);
    }
}

/* ---- weights ---- */
/* Each hypothesis has templates of its own, learnt from its heaviest particle. */
static void learn_appearance(gait_tracker *t, int32_t hypothesis, int32_t best)
{
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        if (t->camera[c].features.has_image && t->template[hypothesis][c] && t->texture)
            template_update(t->template[hypothesis][c], t->model->limbs, texture_of(t, best, c));
}

static double log_add(double a, double b)
{
    double const top = a > b ? a : b;
    return top + m_log64(m_exp64(a - top) + m_exp64(b - top));
}

/* Log evidence of this frame for the second hypothesis over the first: without the silhouette, for the odds, and of all
 * terms. */
static void update_odds(gait_tracker *t, float dt, double without_silhouette, double all)
{
    hypotheses_state *const h = &t->core->hypotheses;
    double const share = (double)hypotheses_evidence_share(t, dt);
    bool const supported_lately = seconds_unsupported(t) < 1.5f * dt;
    h->recent_log_ratio += share * (all - h->recent_log_ratio);
    if (supported_lately && seconds_in_stage(t) >= REFIT_TIME)
        h->log_odds += share * without_silhouette;
}

/* The more probable hypothesis; while that is open, the one that has explained the last frames better. */
static int32_t reported_hypothesis(const hypotheses_state *h)
{
    return h->log_odds > 1.0 || (h->log_odds > -1.0 && h->recent_log_ratio > 0.0);
}

static pf_summary update_hypotheses(gait_tracker *t, float dt)
{
    pf_summary s[2], all;
    double without_silhouette[2], of_all[2];
    for (int32_t h = 0; h < 2; h++) {
        pf f = filter_of(&t->filter, h);
        int32_t const first = hypothesis_first(t->filter.n, h);
        without_silhouette[h] = evidence_of(&f, t->loglik_without_silhouette + first);
        of_all[h] = evidence_of(&f, t->loglik_raw + first);
        if (hypotheses_acquiring(t))
            evidence_anneal(&f, t->loglik + first, UNKNOWN_ESS);
        s[h] = pf_update(&f, t->loglik + first);
        s[h].best += first;
        if (s[h].degenerate)
            scale_weights(&f, -log_probability(t, h));
        learn_appearance(t, h, s[h].best);
    }
    if (!s[0].degenerate && !s[1].degenerate)
        update_odds(t, dt, without_silhouette[1] - without_silhouette[0], of_all[1] - of_all[0]);
    for (int32_t h = 0; h < 2; h++) {
        pf f = filter_of(&t->filter, h);
        scale_weights(&f, log_probability(t, h));
    }
    all = s[reported_hypothesis(&t->core->hypotheses)];
    all.log_evidence = log_add(s[0].log_evidence, s[1].log_evidence);
    all.degenerate = s[0].degenerate && s[1].degenerate;
    all.ess = pf_ess(&t->filter);
    return all;
}

pf_summary hypotheses_update(gait_tracker *t, float dt)
{
    evidence_temper(t->loglik, t->cfg.particles, hypotheses_evidence_share(t, seconds_unsupported(t)));
    if (t->core->hypotheses.stage == HYPOTHESES_TWO)
        return update_hypotheses(t, dt);
    if (t->core->hypotheses.stage == HYPOTHESES_ACQUISITION)
        evidence_anneal(&t->filter, t->loglik, t->core->hypotheses.phase_known ? KNOWN_ESS : UNKNOWN_ESS);
    return pf_update(&t->filter, t->loglik);
}
