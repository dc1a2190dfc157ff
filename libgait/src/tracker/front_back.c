#include "tracker/front_back.h"
#include "base/fmath.h"
#include "image/camera.h"
#include "tracker/likelihood_step.h"

static const float SIDE_VIEW = 0.3f; /* least sine of the angle between heading and viewing direction */
static const float EDGE_SHARE =
    0.5f; /* share of the edge strength beyond chance by which the front must be better */
static const float AVERAGE_TIME = 1.0f; /* seconds over which the score is averaged */
static const float FIRST_SCORE = 0.03f; /* initial value of the average */

/* Seen from in front or behind, a turn by 180 degrees changes little. */
static bool viewed_from_side(const gait_camera *c, const particle_state *p)
{
    float to[3], sn, cs;
    camera_to(c, p->f + F_X, to);
    m_sincos_one(p->f[F_HEADING], &sn, &cs);
    float const across = cs * to[1] - sn * to[0];
    return across * across > SIDE_VIEW * SIDE_VIEW * (to[0] * to[0] + to[1] * to[1]);
}

bool front_back_visible(const gait_tracker *t, const particle_state *p)
{
    bool any = false;
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        any |= viewed_from_side(&t->cfg.camera[c], p);
    return any;
}

/* The body in the first lane; in the others the body turned by 180 degrees, at evenly spaced phases. */
static void turned_bodies(const particle_state *p, particle_block *out)
{
    particle_set all = {.n = BLOCK, .fields = F_MAX, .value = out->f[0]};
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        particle_state one = *p;
        if (lane > 0) {
            one.f[F_PHASE] = m_wrap1(p->f[F_PHASE] + (float)lane / (float)(BLOCK - 1));
            one.f[F_HEADING] = m_wrap_pi_one(p->f[F_HEADING] + PI_F);
        }
        particle_put(&all, lane, &one);
    }
}

float front_back_score(gait_tracker *t, const state_layout *of, const particle_state *p)
{
    likelihood_scratch *const w = &t->work[0];
    particle_block bodies;
    float sum = 0.0f, cameras = 0.0f;
    turned_bodies(p, &bodies);
    particle_block_bodies(of, &bodies, &w->body);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        float edges[BLOCK], chance[BLOCK], turned = 0.0f;
        if (!t->camera[c].features.has_image || !viewed_from_side(&t->cfg.camera[c], p))
            continue;
        likelihood_outline(t, c, w);
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            like_body const b = likelihood_body(t, c, 0, lane, w, NULL);
            edges[lane] = like_edges_along(&b, &chance[lane]);
            turned = lane > 0 ? f_max(turned, edges[lane]) : turned;
        }
        sum += edges[0] - turned - EDGE_SHARE * (edges[0] - chance[0]);
        cameras += 1.0f;
    }
    return cameras > 0.0f ? sum / cameras : 0.0f;
}

/* While only parts of the body are visible, the score is not updated: the edges of the occluder are no evidence. */
float front_back_update(gait_tracker *t, bool restart, const state_layout *of, const particle_state *mean)
{
    float const before = t->core->front_back_margin;
    if (restart)
        return FIRST_SCORE;
    if (t->core->partly_hidden || !(t->cfg.terms & GAIT_TERM_EDGES))
        return before;
    return running_mean(t, before, front_back_score(t, of, mean), AVERAGE_TIME);
}
