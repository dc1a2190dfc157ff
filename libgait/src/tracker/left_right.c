#include "tracker/left_right.h"
#include "base/fmath.h"
#include "tracker/hypotheses.h"
#include "tracker/likelihood_step.h"

float left_right_update(gait_tracker *t, bool restart, float dt, const state_layout *of,
                        const particle_state *mean)
{
    float const before = t->core->left_right_margin;
    if (restart)
        return REPORT_LOG_ODDS;
    if (!(t->cfg.terms & GAIT_TERM_KEYPOINTS) || of->model->direction == 0)
        return before;
    particle_state const mirrored = mirror_apply(&t->mirror[of->model->motion_class], of, mean);
    float const better = likelihood_of_keypoints(t, of, mean) - likelihood_of_keypoints(t, of, &mirrored);
    float const nats = hypotheses_evidence_share(t, dt) * t->cfg.keypoints_weight * better;
    return f_clamp(before + nats, -REPORT_LOG_ODDS, REPORT_LOG_ODDS);
}
