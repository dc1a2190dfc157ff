#include "tracker/left_right.h"
#include "base/fmath.h"
#include "tracker/likelihood_step.h"

static const float AVERAGE_TIME = 1.5f; /* seconds over which the score is averaged */
static const float FIRST_SCORE = 1.0f;  /* initial value of the average */
static const float WORSE =
    3.0f; /* weight of evidence for the mirror image: a quarter of it leaves left and right open */

/* How much better the keypoints fit the body than its mirror image half a stride later, in units of the term's cost. */
static float left_right_score(gait_tracker *t, const state_layout *of, const particle_state *p)
{
    particle_state const mirrored = mirror_apply(&t->mirror[of->model->motion_class], of, p);
    return likelihood_of_keypoints(t, of, p) - likelihood_of_keypoints(t, of, &mirrored);
}

float left_right_update(gait_tracker *t, bool restart, const state_layout *of, const particle_state *mean)
{
    float const before = t->core->left_right_margin;
    if (restart)
        return FIRST_SCORE;
    if (!(t->cfg.terms & GAIT_TERM_KEYPOINTS) || of->model->direction == 0)
        return before;
    float const score = left_right_score(t, of, mean);
    return running_mean(t, before, score < 0.0f ? WORSE * score : score, AVERAGE_TIME);
}
