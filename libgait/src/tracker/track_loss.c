#include "tracker/track_loss.h"
#include "tracker/estimate.h"
#include "tracker/front_back.h"
#include "base/fmath.h"
#include "tracker/hypotheses.h"
#include "tracker/likelihood_step.h"
#include <string.h>

static const float PATIENCE = 0.33f;   /* seconds without support until the walker is lost */
static const float PHASE_KEEPS = 1.5f; /* seconds for which a lost walker's phase can be predicted */
static const float SAME_PHASE = 0.15f; /* strides within which the prediction counts as met */
static const float HIDDEN = -4.0f;     /* log probability of being hidden in a frame, */
static const float SEEN = 3.0f;        /* nats by which parts that are seen can raise it, */
static const float STRANGE = 3.0f; /* and how many times foreground beyond the usual speaks against them */
static const float PART = 1.0f;    /* nats for a walker who is seen in part */
static const float USUAL = 60.0f,
                   BETTER = 10.0f;    /* frames in which more, or less, unexplained foreground is usual */
static const double ELSEWHERE = 0.01; /* probability, in a frame, that a lost walker is not where predicted */
enum { SEARCHERS = 8 };               /* one particle of so many looks there */
static const float FRONT_BACK_TIME = 1.0f;   /* seconds over which front_back_score() is averaged, */
static const float FRONT_BACK_FIRST = 0.03f; /* and what it is taken for at first */

bool track_loss_is_lost(const gait_tracker *t)
{
    return seconds_unseen(t) > PATIENCE;
}

bool track_loss_doubts_front(const gait_tracker *t)
{
    return t->core->front_back < 0.0f;
}

/* Where somebody may be who was last seen as `from`, `gap` seconds ago. */
static void region(const gait_tracker *t, float gap, gait_state *mean, gait_state *sd)
{
    const particle_state *const from = &t->core->last;
    float sn, cs;
    *mean = particle_to_state(&t->rule, from);
    float const way = gap * estimate_speed(t, from), far = f_min(0.1f + 0.4f * gap, 1.5f);
    m_sincos_one(mean->heading, &sn, &cs);
    mean->pelvis[0] += way * cs;
    mean->pelvis[1] += way * sn;
    *sd = (gait_state){.phase = 0.5f,
                       .stride_hz = 0.05f * mean->stride_hz,
                       .stature = 0.01f * mean->stature,
                       .heading = f_min(0.1f + 0.3f * gap, PI_F),
                       .pelvis = {far, far, 0.02f}};
    for (int32_t k = 0; k < t->rule.components; k++)
        sd->coef[k] = 0.3f;
}

void track_loss_search(gait_tracker *t, uint32_t frame)
{
    gait_state mean, sd;
    dynamics d = tracker_dynamics(t);
    if (!track_loss_is_lost(t) ||
        t->core->hypotheses.stage == HYPOTHESES_TWO) /* two sides go on as predicted for a while */
        return;
    region(t, seconds_unseen(t), &mean, &sd);
    d.seed += (uint64_t)(frame + 1) << 32; /* draws of its own in every frame */
    int32_t const n = t->cfg.particles, drawn = (n + SEARCHERS - 1) / SEARCHERS;
    double const follow = (1.0 - ELSEWHERE) / (double)(n - drawn), elsewhere = ELSEWHERE / (double)drawn;
    for (int32_t i = 0; i < n; i++) {
        bool const anew = i % SEARCHERS == 0;
        t->filter.weight[i] = anew ? elsewhere : follow;
        t->filter.log_weight[i] = m_log64(t->filter.weight[i]);
        if (anew) {
            particle_state const w = dynamics_draw(&d, &mean, &sd, i);
            particle_put(&t->particles, i, &w);
        }
    }
    t->core->textured = 0; /* the ancestors were elsewhere */
}

/* What foreground says for a walker who may be hidden in part, nats: what is explained, and what is left over
 * beyond the usual. */
static float parts_speak(float explained, float more)
{
    return explained - STRANGE * f_max(0.0f, more);
}

/* The particle that explains the frame best; -1: none can be compared. */
static int32_t likeliest(const gait_tracker *t)
{
    int32_t best = -1;
    float top = -INFINITY;
    for (int32_t i = 0; i < t->cfg.particles; i++) {
        float const ll = t->loglik_raw[i];
        if (ll > top && ll <= FLT_MAX) {
            top = ll;
            best = i;
        }
    }
    return best;
}

/* t->used, what each particle explains of all the foreground, becomes what that says for a hidden walker. */
static void credit_parts(gait_tracker *t, float foreground)
{
    float const usual = t->core->missed;
    for (int32_t i = 0; i < t->cfg.particles; i++)
        t->loglik[i] = f_clamp(parts_speak(t->loglik[i], foreground - t->loglik[i] - usual), 0.0f, SEEN);
}

void track_loss_allow_hidden(gait_tracker *t)
{
    int32_t const n = t->cfg.particles, best = likeliest(t);
    likelihood_verdict s = {.support = 0.0f}; /* also if no term has an opinion on whether anybody is there */
    if (t->cfg.mode != GAIT_MODE_PAPER && best >= 0) {
        particle_state const w = particle_get(&t->particles, best);
        s = likelihood_of_particle(t, &w);
    }
    if (s.support != 0.0f) {
        credit_parts(t, s.parts.explained + s.parts.missed);
        t->like->run->track_loss_join(t->loglik_raw, t->loglik_raw[best] - s.support + HIDDEN, n, t->loglik);
    } else {
        memcpy(t->loglik, t->loglik_raw, (size_t)n * sizeof *t->loglik);
    }
}

/* Did the walker go on walking while nobody saw it?  Then left and right are as they were. */
static bool as_predicted(const gait_tracker *t, const particle_state *mean)
{
    float const gap = seconds_unseen(t), turn = gap * t->core->last.f[F_RATE];
    float const off = m_wrap_pi(TWO_PI_F * (mean->f[F_PHASE] - t->core->last.f[F_PHASE] - turn)) / TWO_PI_F;
    return gap < PHASE_KEEPS && fabsf(off) < SAME_PHASE;
}

/* Is the walker seen as a whole, or, unless lost, in part? */
static bool seen(gait_tracker *t, bool lost, const likelihood_verdict *s)
{
    float *const usual = &t->core->missed;
    float const more = s->parts.missed - *usual;
    /* Terms without an opinion on whether anybody is there give exactly zero. */
    bool const whole = s->support >= 0.0f;
    t->core->part = !whole && !lost && t->core->met && parts_speak(s->parts.explained, more) > PART;
    if (whole)
        *usual += t->core->met ? more / (more > 0.0f ? USUAL : BETTER) : more;
    return whole || t->core->part;
}

/* Edges of what hides a part of the walker tell nothing, so only a whole one counts. */
static void watch_front_back(gait_tracker *t, bool anew, const particle_state *mean)
{
    float *const facing = &t->core->front_back;
    if (anew)
        *facing = FRONT_BACK_FIRST;
    else if (!t->core->part && (t->cfg.terms & GAIT_TERM_EDGES)) {
        float const now = front_back_score(t, mean), share = f_min(seconds_unseen(t) / FRONT_BACK_TIME, 1.0f);
        *facing += now == 0.0f ? 0.0f : share * (now - *facing);
    }
}

void track_loss_update(gait_tracker *t, const particle_state *mean)
{
    bool const lost = track_loss_is_lost(t);
    likelihood_verdict const sight = likelihood_of_particle(t, mean);
    if (!seen(t, lost, &sight)) {
        if (lost && (t->core->hypotheses.stage != HYPOTHESES_TWO || seconds_unseen(t) > PHASE_KEEPS))
            hypotheses_drop(t);
        return;
    }
    bool const keeps = t->core->hypotheses.known || t->core->hypotheses.stage == HYPOTHESES_TWO;
    if (lost && !(keeps && as_predicted(t, mean)))
        hypotheses_acquire(t);
    watch_front_back(t, lost || !t->core->met, mean);
    t->core->support_utime = t->core->utime;
    t->core->last = *mean;
    t->core->met = 1;
}
