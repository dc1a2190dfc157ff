#include "tracker/track_loss.h"
#include "base/fmath.h"
#include "tracker/likelihood_step.h"
#include "tracker/walk_check.h"
#include <string.h>

static const float LOST_AFTER_S = 0.33f; /* seconds without support after which the person is lost */
static const float PHASE_TIME = 1.5f;    /* seconds over which the phase of a lost person can be predicted */
static const float PHASE_WITHIN = 0.15f; /* strides from the prediction that count as agreement */
static const float LOG_HIDDEN = -4.0f;   /* log probability of being hidden in a frame */
static const float PARTS_MOST = 3.0f;    /* nats by which visible parts can raise that at most */
static const float UNUSUAL_COST = 3.0f;  /* nats per nat of foreground left unexplained beyond the usual */
static const float PARTS_ENOUGH = 1.0f;  /* nats for a person who is visible in part */
static const float RISE = 60.0f,
                   FALL = 10.0f;      /* time constants of the usual unexplained foreground, frames */
static const double ELSEWHERE = 0.01; /* probability in a frame that a lost person is not where predicted */
enum { REDRAWN = 8 };                 /* one particle in eight is redrawn */

bool track_loss_is_lost(const gait_tracker *t)
{
    return seconds_unsupported(t) > LOST_AFTER_S;
}

/* Class of the last supported estimate. */
static const state_layout *last_layout(const gait_tracker *t)
{
    return &t->layouts[t->classes ? t->classes->supported : 0];
}

/* Where a person may be who was last seen `gap` seconds ago. */
static void search_region(const gait_tracker *t, float gap, gait_state *mean, gait_state *sd)
{
    const particle_state *const last = &t->core->last_supported;
    const state_layout *const of = last_layout(t);
    float sn, cs;
    *mean = particle_to_state(of, last);
    float const way = way_of_walk(t, of, last, gap), far = f_min(0.1f + 0.4f * gap, 1.5f);
    m_sincos_one(mean->heading, &sn, &cs);
    mean->pelvis[0] += way * cs;
    mean->pelvis[1] += way * sn;
    *sd = (gait_state){.phase = 0.5f,
                       .stride_hz = 0.05f * mean->stride_hz,
                       .stature = 0.01f * mean->stature,
                       .heading = f_min(0.1f + 0.3f * gap, PI_F),
                       .pelvis = {far, far, 0.02f}};
    for (int32_t k = 0; k < t->layout.components; k++)
        sd->coef[k] = 0.3f;
}

void track_loss_redraw(gait_tracker *t, uint32_t counter)
{
    gait_state mean, sd;
    double share = 1.0;
    int32_t of = -1;
    dynamics d;
    search_region(t, seconds_unsupported(t), &mean, &sd);
    int32_t const n = t->cfg.particles, drawn = (n + REDRAWN - 1) / REDRAWN;
    double const follow = (1.0 - ELSEWHERE) / (double)(n - drawn), elsewhere = ELSEWHERE / (double)drawn;
    for (int32_t i = 0; i < n; i++) {
        bool const redrawn = i % REDRAWN == 0;
        if (class_at(t, i) != of) {
            of = class_at(t, i);
            share = t->classes ? t->filter.weight[i] * (double)n : 1.0; /* even within a class */
            d = tracker_dynamics(t, of);
            d.seed += (uint64_t)(counter + 1) << 32; /* other draws in every frame */
        }
        t->filter.weight[i] = share * (redrawn ? elsewhere : follow);
        t->filter.log_weight[i] = t->filter.weight[i] > 0.0 ? m_log64(t->filter.weight[i]) : -1e300;
        if (redrawn) {
            particle_state const p = dynamics_draw(&d, &mean, &sd, NULL, i);
            particle_put(&t->particles, i, &p);
        }
    }
}

/* Evidence of the foreground for a partly hidden person, nats; unusual: unexplained foreground beyond the usual. */
static float parts_evidence(float explained, float unusual)
{
    return explained - UNUSUAL_COST * f_max(0.0f, unusual);
}

/* The particle of the largest finite log-likelihood, or -1. */
static int32_t likeliest(const gait_tracker *t)
{
    int32_t best = -1;
    float top = -INFINITY;
    for (int32_t i = 0; i < t->cfg.particles; i++) {
        float const nats = t->loglik_raw[i];
        if (nats > top && nats <= FLT_MAX) {
            top = nats;
            best = i;
        }
    }
    return best;
}

/* The lower bound of a particle is the log-likelihood of the empty scene, plus that of being hidden, plus what its visible
 * parts explain.  It is computed in t->explained, which becomes t->loglik element by element. */
void track_loss_bound(gait_tracker *t)
{
    int32_t const n = t->cfg.particles, best = likeliest(t);
    body_evidence e = {.support = 0.0f};
    if (t->cfg.mode != GAIT_MODE_PAPER && best >= 0) {
        particle_state const p = particle_get(&t->particles, best);
        e = likelihood_of_particle(t, layout_at(t, best), &p);
    }
    if (e.support == 0.0f) { /* no term distinguishes a hidden person from a visible one */
        memcpy(t->loglik, t->loglik_raw, (size_t)n * sizeof *t->loglik);
        return;
    }
    float const foreground = e.parts.explained + e.parts.missed, usual = t->core->usual_unexplained;
    for (int32_t i = 0; i < n; i++) {
        float const explained = t->explained[i];
        t->explained[i] =
            f_clamp(parts_evidence(explained, foreground - explained - usual), 0.0f, PARTS_MOST);
    }
    t->like->run->track_loss_join(t->loglik_raw, t->loglik_raw[best] - e.support + LOG_HIDDEN, n, t->loglik);
}

static bool phase_as_predicted(const gait_tracker *t, float gap, const state_layout *of,
                               const particle_state *mean)
{
    const particle_state *const last = &t->core->last_supported;
    int32_t const direction = last_layout(t)->model->direction;
    float const turn = in_walking_time(t, gap) * last->f[F_RATE] * (float)direction;
    if (direction != of->model->direction)
        return false;
    float const off = m_wrap_pi_one(TWO_PI_F * (mean->f[F_PHASE] - last->f[F_PHASE] - turn)) / TWO_PI_F;
    return gap < PHASE_TIME && fabsf(off) < PHASE_WITHIN;
}

track_loss_verdict track_loss_check(gait_tracker *t, bool lost, const state_layout *of,
                                    const particle_state *mean)
{
    const tracker_core *const core = t->core;
    float const gap = seconds_unsupported(t);
    body_evidence const e = likelihood_of_particle(t, of, mean);
    float const unusual = e.parts.missed - core->usual_unexplained;
    bool const whole = e.support >= 0.0f && walk_check_passes(t); /* support is 0 if no term applies */
    bool const part = !whole && !lost && core->found &&
                      parts_evidence(e.parts.explained - e.chance, unusual) > PARTS_ENOUGH;
    track_loss_verdict v = {.support = whole  ? SUPPORT_WHOLE
                                       : part ? SUPPORT_PART
                                              : SUPPORT_NONE,
                            .by_images = e.support - e.by_keypoints,
                            .usual_unexplained = core->usual_unexplained,
                            .phase_as_predicted = phase_as_predicted(t, gap, of, mean),
                            .phase_expired = gap > PHASE_TIME};
    if (whole)
        v.usual_unexplained += core->found ? unusual / (unusual > 0.0f ? RISE : FALL) : unusual;
    return v;
}
