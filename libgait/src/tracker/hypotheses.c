#include "tracker/hypotheses.h"
#include "image/camera.h"
#include "filter/evidence.h"
#include "base/fmath.h"
#include "base/rng.h"
#include "tracker/likelihood_step.h"
#include <string.h>

static const float SEARCH = 0.5f; /* seconds until the phase is known modulo half a stride */
static const float REFIT = 0.4f;  /* seconds in which both sides find their own best before evidence counts */
static const float SPREAD_SCORE = 0.5f, SPREAD_HEADING = 0.1f, SPREAD_RATE = 0.02f, SPREAD_PHASE = 0.05f;
static const double SURE = 4.5;    /* log odds from which one side is reported as the truth (0.99) */
static const double DECIDED = 9.0; /* and from which the other is given up */

static float seconds_in_stage(const gait_tracker *t)
{
    return 1e-6f * (float)(t->core->utime - t->core->hypotheses.since);
}

float hypotheses_settled_time(const gait_tracker *t)
{
    return t->core->hypotheses.stage == HYPOTHESES_ONE ? seconds_in_stage(t) : 0.0f;
}

static void enter(gait_tracker *t, int32_t stage)
{
    t->core->hypotheses =
        (hypotheses_state){.stage = stage, .since = t->core->utime, .known = stage == HYPOTHESES_ONE};
}

void hypotheses_acquire(gait_tracker *t)
{
    enter(t, t->cfg.mode == GAIT_MODE_PAPER ? HYPOTHESES_ONE : HYPOTHESES_ACQUISITION);
}

void hypotheses_settle(gait_tracker *t)
{
    enter(t, HYPOTHESES_ONE);
}

void hypotheses_drop(gait_tracker *t)
{
    t->core->hypotheses.stage = HYPOTHESES_ONE;
}

/* First particle of a side; side 2: the end. */
static int32_t first_of(const pf *f, int32_t side)
{
    return side == 0 ? 0 : side == 1 ? (f->n + 1) / 2 : f->n;
}

int32_t hypotheses_boundary(const gait_tracker *t)
{
    return first_of(&t->filter, t->core->hypotheses.stage == HYPOTHESES_TWO ? 1 : 2);
}

/* One side's particles as a filter of its own. */
static pf filter_of(const pf *f, int32_t side)
{
    int32_t const first = first_of(f, side);
    return (pf){.n = first_of(f, side + 1) - first,
                .log_weight = f->log_weight + first,
                .weight = f->weight + first,
                .parent = f->parent + first,
                .cumulative = f->cumulative + first};
}

/* Log of the weight of a side: log of the logistic function of the odds for it. */
static double log_share(const gait_tracker *t, int32_t side)
{
    double const odds = side == 1 ? t->core->hypotheses.odds : -t->core->hypotheses.odds;
    return odds > 0.0 ? -m_log64(1.0 + m_exp64(-odds)) : odds - m_log64(1.0 + m_exp64(odds));
}

/* Make a side whose weights sum to 1 weigh what its odds say. */
static void scale(pf *side, double log_factor)
{
    double const factor = m_exp64(log_factor);
    for (int32_t i = 0; i < side->n; i++) {
        side->weight[i] *= factor;
        side->log_weight[i] += log_factor;
    }
}

static double total(const pf *side)
{
    double sum = 0.0;
    for (int32_t i = 0; i < side->n; i++)
        sum += side->weight[i];
    return sum;
}

/* Do too few of a side's particles weigh anything? */
static bool hypothesis_is_spent(const gait_tracker *t, int32_t side)
{
    pf const h = filter_of(&t->filter, side);
    double const sum = total(&h);
    return pf_ess(&h) * sum * sum < (double)t->cfg.resample_ess * (double)h.n;
}

static void resample_hypothesis(gait_tracker *t, int32_t side, uint32_t u)
{
    pf h = filter_of(&t->filter, side);
    pf_resample_systematic(&h, u);
    for (int32_t i = 0; i < h.n; i++)
        h.parent[i] += first_of(&t->filter, side);
    scale(&h, log_share(t, side));
}

/* Give the loser up: its particles weigh nothing, and the next resampling replaces them. */
static void merge_hypotheses(gait_tracker *t)
{
    int32_t const loser = t->core->hypotheses.odds < 0.0;
    pf gone = filter_of(&t->filter, loser), left = filter_of(&t->filter, 1 - loser);
    for (int32_t i = 0; i < gone.n; i++) {
        gone.weight[i] = 0.0;
        gone.log_weight[i] = -1e300;
    }
    scale(&left, -log_share(t, 1 - loser));
    for (int32_t c = 0; c < t->cfg.cameras && t->template[0][c]; c++)
        if (loser == 0)
            memcpy(t->template[0][c], t->template[1][c],
                   (size_t)t->model->limbs * LIKE_SAMPLES * sizeof *t->template[0][c]);
    enter(t, HYPOTHESES_ONE);
    t->core->ess = 0.0;
}

static bool acquisition_is_over(const gait_tracker *t)
{
    return t->core->hypotheses.stage == HYPOTHESES_ACQUISITION && seconds_in_stage(t) >= SEARCH;
}

static bool resample_all(gait_tracker *t, const uint32_t u, uint32_t frame)
{
    double const least = (double)t->cfg.resample_ess * (double)t->cfg.particles;
    if (t->core->ess >= least && t->cfg.resample_ess < 1.0f && !acquisition_is_over(t))
        return false;
    if (t->cfg.mode == GAIT_MODE_PAPER)
        pf_resample_multinomial(&t->filter, t->cfg.seed, STREAM_RESAMPLE, frame);
    else
        pf_resample_systematic(&t->filter, u);
    return true;
}

bool hypotheses_resample(gait_tracker *t, uint32_t frame)
{
    const hypotheses_state *const m = &t->core->hypotheses;
    uint32_t r[4];
    rng_bits(t->cfg.seed, STREAM_RESAMPLE, frame, 0, 0, r);
    pf_keep(&t->filter);
    if (m->stage == HYPOTHESES_TWO && (m->odds > DECIDED || m->odds < -DECIDED))
        merge_hypotheses(t);
    if (m->stage != HYPOTHESES_TWO && tracker_count(t) != t->filter.n) {
        pf_resize(&t->filter, tracker_count(t), r[0]);
        return true;
    }
    if (m->stage != HYPOTHESES_TWO)
        return resample_all(t, r[0], frame);
    if (!hypothesis_is_spent(t, 0) && !hypothesis_is_spent(t, 1))
        return false;
    for (int32_t side = 0; side < 2; side++) /* both, since they mingle in the same step */
        resample_hypothesis(t, side, r[side]);
    return true;
}

/* Phase modulo half a stride that most particles agree on: the mean of the doubled angle. */
static float half_phase(const particle_set *p)
{
    const float *const phase = field(p, F_PHASE);
    double c = 0.0, s = 0.0;
    for (int32_t i = 0; i < p->n; i++) {
        float sn, cs;
        m_sincos_one(2.0f * TWO_PI_F * phase[i], &sn, &cs);
        c += (double)cs;
        s += (double)sn;
    }
    return 0.5f * m_atan2((float)s, (float)c) / TWO_PI_F;
}

/* Heading seen in a mirror that is square to the first camera's line of sight: far for near.  Without
 * perspective the picture of a body and that of its reflection are the same. */
static float reflected(const gait_tracker *t, const particle_state *w)
{
    float at[3];
    camera_to(&t->cfg.camera[0], w->f + F_X, at);
    return m_wrap_pi(2.0f * m_atan2(at[1], at[0]) + PI_F - w->f[F_HEADING]);
}

/* The other reading of the same picture.  Every second one also swaps near and far, where that turns the
 * walker by less than a quarter: seen from in front the legs change places without it. */
static particle_state other_hypothesis(const gait_tracker *t, const particle_state *w, int32_t i)
{
    particle_state to = mirror_apply(t->mirror, &t->rule, w);
    float const heading = reflected(t, w);
    if ((i & 1) && fabsf(m_wrap_pi(heading - w->f[F_HEADING])) < 0.5f * PI_F)
        to.f[F_HEADING] = heading;
    return to;
}

/* Spread a particle: its side must find its own best heading, gait and phase, not those that suited the other. */
static void spread(const gait_tracker *t, int32_t i, particle_state *w)
{
    float n[4];
    for (int32_t k = 0; k < t->rule.components; k++) {
        if (k % 4 == 0)
            rng_normal4(t->cfg.seed, STREAM_SPLIT, (uint32_t)(k / 4 + 1), (uint32_t)i, 0, n);
        w->f[F_COEF + k] += SPREAD_SCORE * n[k % 4];
    }
    rng_normal4(t->cfg.seed, STREAM_SPLIT, 0, (uint32_t)i, 0, n);
    w->f[F_HEADING] = m_wrap_pi(w->f[F_HEADING] + SPREAD_HEADING * n[0]);
    w->f[F_RATE] *= 1.0f + SPREAD_RATE * n[1];
    w->f[F_PHASE] = m_wrap1(w->f[F_PHASE] + SPREAD_PHASE * n[2]);
}

/* Put the particles with even numbers first, the others behind them: the two sides. */
static void deal(gait_tracker *t)
{
    pf *const f = &t->filter;
    int32_t const n = f->n, second = first_of(f, 1);
    float *const was = t->loglik; /* this frame has not filled it yet */
    for (int32_t k = 0; k < t->particles.fields; k++) {
        float *const now = field(&t->particles, k);
        memcpy(was, now, (size_t)n * sizeof *was);
        for (int32_t i = 0; i < n; i++)
            now[i] = was[i < second ? 2 * i : 2 * (i - second) + 1];
    }
    for (int32_t i = 0; i < n; i++)
        f->cumulative[i] = (uint64_t)f->parent[i];
    for (int32_t i = 0; i < n; i++)
        f->parent[i] = (int32_t)f->cumulative[i < second ? 2 * i : 2 * (i - second) + 1];
}

typedef struct split_job {
    const gait_tracker *t;
    particle_set particles;
    float middle; /* phase of the first side */
} split_job;

/* Bring particles to the side they were dealt to. */
static void split_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    split_job *const j = ctx;
    (void)task;
    for (int32_t i = begin; i < end; i++) {
        int32_t const side = i >= first_of(&j->t->filter, 1);
        particle_state w = particle_get(&j->particles, i);
        bool const far = fabsf(m_wrap_pi(TWO_PI_F * (w.f[F_PHASE] - j->middle))) > 0.5f * PI_F;
        if (far != (side == 1))
            w = other_hypothesis(j->t, &w, i);
        spread(j->t, i, &w);
        particle_put(&j->particles, i, &w);
    }
}

/* The particles are even, as resampled.  They are dealt in turn to both sides, those that are of the other one mirrored:
 * the odds begin even whatever the search made of left and right. */
void hypotheses_split(gait_tracker *t)
{
    pf *const f = &t->filter;
    if (!acquisition_is_over(t))
        return;
    split_job j = {.t = t, .particles = t->particles, .middle = half_phase(&t->particles)};
    deal(t);
    task_run(&t->cfg.exec, t->cfg.tasks, f->n, BLOCK, split_range, &j);
    t->core->textured = 0; /* what the ancestors looked like is not what their mirrored bodies would */
    enter(t, HYPOTHESES_TWO);
    for (int32_t side = 0; side < 2; side++) {
        pf h = filter_of(f, side);
        pf_uniform(&h);
        scale(&h, log_share(t, side));
        for (int32_t c = 0; c < t->cfg.cameras && t->template[side][c]; c++)
            template_clear(t->template[side][c], t->model->limbs);
    }
}

/* Share at which evidence counts so many seconds after the last: errors of the image terms outlast that. */
static float share_of_news(const gait_tracker *t, float since)
{
    float const lasting = t->cfg.evidence_time;
    return since > 0.0f && since < lasting ? since / lasting : 1.0f;
}

/* The looks of each side's heaviest particle. */
static void remember(gait_tracker *t, int32_t side, int32_t best)
{
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        if (t->camera[c].features.has_image && t->template[side][c] && t->texture)
            template_update(t->template[side][c], t->model->limbs, texture_of(t, best, c));
}

/* Sum of the sides' evidence, each times its weight. */
static double joined(double a, double b)
{
    double const top = a > b ? a : b;
    return top + m_log64(m_exp64(a - top) + m_exp64(b - top));
}

/* Move the sides' weights by what this frame says for the second over the first: of the terms that decide,
 * and of all. */
static void decide(gait_tracker *t, float dt, double inner, double all)
{
    hypotheses_state *const m = &t->core->hypotheses;
    double const share = (double)share_of_news(t, dt);
    bool const seen = seconds_unseen(t) < 1.5f * dt;
    m->lead += share * (all - m->lead);
    if (seen && seconds_in_stage(t) >= REFIT)
        m->odds += share * inner;
}

/* The side to report: the likelier one, or while that is open the one that explains the frames better. */
static int32_t reported_hypothesis(const hypotheses_state *m)
{
    return m->odds > 1.0 || (m->odds > -1.0 && m->lead > 0.0);
}

static pf_summary update_hypotheses(gait_tracker *t, float dt)
{
    pf_summary s[2], all;
    double inner[2], whole[2];
    for (int32_t side = 0; side < 2; side++) {
        pf h = filter_of(&t->filter, side);
        int32_t const first = first_of(&t->filter, side);
        inner[side] = evidence_of(&h, t->loglik_without_silhouette + first);
        whole[side] = evidence_of(&h, t->loglik_raw + first);
        if (hypotheses_acquiring(t))
            evidence_anneal(&h, t->loglik + first);
        s[side] = pf_update(&h, t->loglik + first);
        s[side].best += first;
        if (s[side].degenerate)
            scale(&h, -log_share(t, side));
        remember(t, side, s[side].best);
    }
    if (!s[0].degenerate && !s[1].degenerate)
        decide(t, dt, inner[1] - inner[0], whole[1] - whole[0]);
    for (int32_t side = 0; side < 2; side++) {
        pf h = filter_of(&t->filter, side);
        scale(&h, log_share(t, side));
    }
    all = s[reported_hypothesis(&t->core->hypotheses)];
    all.log_evidence = joined(s[0].log_evidence, s[1].log_evidence);
    all.degenerate = s[0].degenerate && s[1].degenerate;
    all.ess = pf_ess(&t->filter);
    return all;
}

pf_summary hypotheses_update(gait_tracker *t, float dt)
{
    evidence_temper(t->loglik, t->cfg.particles, share_of_news(t, seconds_unseen(t)));
    if (t->core->hypotheses.stage == HYPOTHESES_TWO)
        return update_hypotheses(t, dt);
    if (t->core->hypotheses.stage == HYPOTHESES_ACQUISITION)
        evidence_anneal(&t->filter, t->loglik);
    return pf_update(&t->filter, t->loglik);
}

bool hypotheses_open(const gait_tracker *t)
{
    const hypotheses_state *const m = &t->core->hypotheses;
    return m->stage == HYPOTHESES_ACQUISITION ||
           (m->stage == HYPOTHESES_TWO && m->odds < SURE && m->odds > -SURE);
}

bool hypotheses_acquiring(const gait_tracker *t)
{
    const hypotheses_state *const m = &t->core->hypotheses;
    return m->stage == HYPOTHESES_ACQUISITION || (m->stage == HYPOTHESES_TWO && seconds_in_stage(t) < REFIT);
}
