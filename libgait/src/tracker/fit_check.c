#include "tracker/fit_check.h"
#include "base/fmath.h"
#include "tracker/likelihood_step.h"

static const float AVERAGE_TIME = 0.7f; /* seconds over which the score is averaged */
static const float FIRST_SCORE = 1.0f;  /* initial value of the average, nats */
/* Bounds of a frame's score, nats: a good fit in the past must not outweigh a bad one now, nor a few wrong keypoints all
 * other frames. */
static const float LEAST_SCORE = -3.0f, MOST_SCORE = 2.0f;

/* The lanes of the bodies: turned by -90 to 90 degrees in steps of 30, the estimate in the middle; then a quarter of a stride
 * behind and ahead, but not for a standing person, who has no phase. */
enum { ESTIMATE = 3, BEHIND = 7, AHEAD, BODIES };

float fit_check_score(gait_tracker *t, const state_layout *of, const particle_state *p)
{
    int32_t const n = of->model->direction == 0 ? BEHIND : BODIES;
    body_evidence e[BODIES];
    float best = -INFINITY;
    particle_block bodies;
    particle_set all = {.n = BLOCK, .fields = F_MAX, .value = bodies.f[0]};
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        particle_state one = *p;
        if (lane < BEHIND)
            one.f[F_HEADING] += (float)(lane - ESTIMATE) * (PI_F / 6.0f);
        else if (lane < BODIES)
            one.f[F_PHASE] = m_wrap1(one.f[F_PHASE] + (lane == AHEAD ? 0.25f : -0.25f));
        particle_put(&all, lane, &one);
    }
    particle_block_bodies(of, &bodies, &t->work[0].body);
    likelihood_of_bodies(t, n, NULL, e);
    for (int32_t lane = 0; lane < n; lane++)
        best = lane == ESTIMATE ? best : f_max(best, e[lane].support);
    return e[ESTIMATE].support - best;
}

float fit_check_update(gait_tracker *t, bool restart, const state_layout *of, const particle_state *mean)
{
    if (restart)
        return FIRST_SCORE;
    if (t->cfg.mode == GAIT_MODE_PAPER)
        return t->core->fit_margin;
    float const score = f_clamp(fit_check_score(t, of, mean), LEAST_SCORE, MOST_SCORE);
    return running_mean(t, t->core->fit_margin, score, AVERAGE_TIME);
}
