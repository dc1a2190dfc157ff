#include "tracker/front_back.h"
#include "image/camera.h"
#include "base/fmath.h"
#include "tracker/likelihood_step.h"

/* Is the walker seen from a side, not from in front or behind, where turning round changes little? */
static bool seen_aside(const gait_camera *c, const particle_state *w)
{
    float const least = 0.3f; /* of the sine of the angle to the line of sight */
    float at[3], sn, cs;
    camera_to(c, w->f + F_X, at);
    m_sincos_one(w->f[F_HEADING], &sn, &cs);
    float const across = cs * at[1] - sn * at[0];
    return across * across > least * least * (at[0] * at[0] + at[1] * at[1]);
}

/* The walker in the first lane, in the others turned round in phases evenly apart. */
static void turn_round(const particle_state *w, particle_block *out)
{
    for (int32_t f = 0; f < F_MAX; f++)
        for (int32_t i = 0; i < BLOCK; i++)
            out->f[f][i] = w->f[f];
    for (int32_t i = 1; i < BLOCK; i++) {
        out->f[F_PHASE][i] = m_wrap1(w->f[F_PHASE] + (float)i / (float)(BLOCK - 1));
        out->f[F_HEADING][i] = m_wrap_pi(w->f[F_HEADING] + PI_F);
    }
}

float front_back_score(gait_tracker *t, const particle_state *person)
{
    likelihood_scratch *const w = &t->work[0];
    particle_block poses;
    float const enough = 0.5f; /* of the edges beyond chance */
    float sum = 0.0f, cameras = 0.0f;
    turn_round(person, &poses);
    particle_block_bodies(&t->rule, &poses, &w->body);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        float along[BLOCK], chance[BLOCK], turned = 0.0f;
        if (!t->camera[c].features.has_image || !seen_aside(&t->cfg.camera[c], person))
            continue;
        likelihood_outline(t, c, w);
        for (int32_t i = 0; i < BLOCK; i++) {
            like_body const b = likelihood_body(t, c, 0, i, w, NULL);
            along[i] = like_edges_along(&b, &chance[i]);
            turned = i > 0 ? f_max(turned, along[i]) : turned;
        }
        sum += along[0] - turned - enough * (along[0] - chance[0]);
        cameras += 1.0f;
    }
    return cameras > 0.0f ? sum / cameras : 0.0f;
}
