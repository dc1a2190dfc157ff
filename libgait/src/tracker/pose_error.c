#include "tracker/pose_error.h"
#include "base/fmath.h"
#include "image/camera.h"
#include "likelihood/likelihood.h"
#include "tracker/likelihood_step.h"

static const float FINEST = 0.5f; /* working pixels: step at which the search ends */

typedef struct sample { /* a block of particles, spread over those of one class */
    int32_t lanes, index[BLOCK];
    particle_block states;
} sample;

static sample draw_sample(const gait_tracker *t)
{
    int32_t const best = pf_heaviest(&t->filter);
    sample s;
    int32_t first = 0, end = t->filter.n;
    if (t->classes) {
        const strata *const of = tracker_strata(t);
        int32_t const k = stratum_at(of, best);
        first = of->first[k];
        end = of->first[k + 1];
    }
    s.lanes = i_min(BLOCK, end - first);
    for (int32_t i = 0; i < s.lanes; i++)
        s.index[i] = first + (int32_t)((int64_t)(end - first) * i / s.lanes);
    s.index[0] = best;
    particle_block_get(&t->particles, s.index, s.lanes, &s.states);
    return s;
}

/* Where the sample's pelvises are in the image, and how far an error of the pose shifts it; false: behind the camera. */
static bool aim(const gait_tracker *t, camera_state *now, const gait_camera *cam, const sample *s)
{
    float uv[2], middle[3] = {0.0f}, sum = 0.0f;
    for (int32_t i = 0; i < s->lanes; i++) {
        float const weight = (float)t->filter.weight[s->index[i]];
        for (int32_t k = 0; k < 3; k++)
            middle[k] += weight * t->work[0].points[0][k][i];
        sum += weight;
    }
    for (int32_t k = 0; k < 3; k++)
        middle[k] /= f_max(sum, 1e-30f);
    float const depth = camera_project(cam, middle, uv);
    if (!(sum > 0.0f && depth > CAMERA_NEAR))
        return false;
    now->aim[0] = uv[0];
    now->aim[1] = uv[1];
    now->shift_sd =
        f_max(cam->fx, cam->fy) *
        __builtin_sqrtf(now->turn_sd * now->turn_sd + now->place_sd * now->place_sd / (depth * depth));
    return true;
}

/* Log probability of a shift, pixels, up to a constant. */
static float score(gait_tracker *t, int32_t c, const sample *s, float du, float dv)
{
    likelihood_scratch *const w = &t->work[0];
    gait_camera *const cam = &t->cfg.camera[c];
    float nats[BLOCK], top = -FLT_MAX, sum = 0.0f;
    gait_camera const aimed = *cam;
    cam->cx += du;
    cam->cy += dv;
    likelihood_particles(t, c, s->index, s->lanes, w, nats);
    *cam = aimed;
    for (int32_t i = 0; i < s->lanes; i++)
        top = f_max(top, nats[i]);
    for (int32_t i = 0; i < s->lanes; i++)
        sum += (float)t->filter.weight[s->index[i]] * m_exp(f_max(nats[i] - top, -80.0f));
    return top + m_log(f_max(sum, 1e-30f));
}

static void correct_camera(gait_tracker *t, int32_t c)
{
    static const float WAY[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    likelihood_scratch *const w = &t->work[0];
    float const scale = t->camera[c].features.map.scale;
    sample const s = draw_sample(t);
    particle_block_bodies(layout_at(t, s.index[0]), &s.states, &w->body);
    kin_points(t->model, &w->body, w->points);
    if (!aim(t, &t->camera[c], &t->cfg.camera[c], &s))
        return;
    float at[2] = {0.0f, 0.0f}, best = score(t, c, &s, 0.0f, 0.0f);
    for (float step = t->camera[c].shift_sd; step * scale > FINEST;) {
        float const from[2] = {at[0], at[1]};
        for (int32_t k = 0; k < 4; k++) {
            float const u = from[0] + step * WAY[k][0], v = from[1] + step * WAY[k][1],
                        found = score(t, c, &s, u, v);
            if (found > best) {
                best = found;
                at[0] = u;
                at[1] = v;
            }
        }
        if (at[0] == from[0] && at[1] == from[1])
            step *= 0.5f;
    }
    t->cfg.camera[c].cx += at[0];
    t->cfg.camera[c].cy += at[1];
}

void pose_error_correct(gait_tracker *t)
{
    bool ready = false;
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        const camera_state *const now = &t->camera[c];
        if (!now->features.has_image || !(now->turn_sd + now->place_sd > 0.0f))
            continue;
        if (!ready)
            likelihood_templates(t);
        ready = true;
        correct_camera(t, c);
    }
}

double pose_error_variance(const gait_tracker *t, const float at[3])
{
    double least = 1e12;
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        float to[3];
        camera_to(&t->cfg.camera[c], at, to);
        double const turn = (double)t->camera[c].turn_sd, place = (double)t->camera[c].place_sd;
        double const square =
            (double)to[0] * (double)to[0] + (double)to[1] * (double)to[1] + (double)to[2] * (double)to[2];
        double const variance = turn * turn * square + place * place;
        least = variance < least ? variance : least;
    }
    return least;
}
