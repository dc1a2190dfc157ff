#include "tracker/likelihood_step.h"
#include "image/camera.h"
#include "likelihood/likelihood.h"
#include <string.h>

void likelihood_outline(const gait_tracker *t, int32_t c, likelihood_scratch *w)
{
    const like_setup *const s = t->like;
    const gait_camera *const cam = &t->cfg.camera[c];
    const view_map *const map = &t->camera[c].features.map;
    s->run->outline_project(s->geometry, s->limbs, &w->body, cam, map, w->outline);
    s->run->layers_prepare(w->outline, s->geometry, s->limbs, w->lines);
    s->run->edges_prepare(w->outline, s->geometry, s->limbs, w->sides);
    s->run->surface_pose(s, cam, map, &w->body, w->pose);
}

like_body likelihood_body(const gait_tracker *t, int32_t c, int32_t hypothesis, int32_t lane,
                          likelihood_scratch *w, like_patch *samples)
{
    like_body b = {.setup = t->like,
                   .features = &t->camera[c].features,
                   .outline = w->outline,
                   .sides = w->sides,
                   .lane = lane,
                   .layers = w->layers,
                   .samples = samples,
                   .camera = &t->cfg.camera[c],
                   .points = (const float (*)[3][BLOCK])w->points,
                   .terms = &w->terms,
                   .known = t->template_ring[hypothesis][c]};
    t->like->run->layers_draw(w->lines, lane, w->layers);
    if (samples)
        t->like->run->surface_sample(t->like, b.features, w->pose, lane, w->layers, samples);
    like_silhouette_count(&b);
    return b;
}

/* ---- bodies before a camera whose pose is uncertain ---- */
typedef struct alignment {
    float by[3][BLOCK],
        nats[BLOCK]; /* metres, world; log-likelihood of the error of the pose that this implies */
} alignment;

/* Displacement of each body of the block, across the view, to where the person appears: the error of the pose that is
 * most probable for it.  Nothing where the pose is exact. */
static bool align(const gait_tracker *t, int32_t c, const likelihood_scratch *w, alignment *a)
{
    const camera_state *const s = &t->camera[c];
    const gait_camera *const cam = &t->cfg.camera[c];
    if (s->shift_sd == 0.0f)
        return false;
    memset(a, 0, sizeof *a);
    for (int32_t i = 0; i < BLOCK; i++) {
        float const pelvis[3] = {w->points[0][0][i], w->points[0][1][i], w->points[0][2][i]};
        float uv[2];
        float const depth = camera_project(cam, pelvis, uv);
        if (!(depth > CAMERA_NEAR))
            continue;
        float const du = s->aim[0] + cam->cx - t->home[c].cx - uv[0],
                    dv = s->aim[1] + cam->cy - t->home[c].cy - uv[1];
        float const u = du + cam->cx - t->home[c].cx, v = dv + cam->cy - t->home[c].cy;
        a->nats[i] = -0.5f * (u * u + v * v) / (s->shift_sd * s->shift_sd);
        for (int32_t k = 0; k < 3; k++)
            a->by[k][i] = depth * (du / cam->fx * cam->R[k] + dv / cam->fy * cam->R[3 + k]);
    }
    return true;
}

/* Displace the bodies and points of the block; `put_back` undoes that to the last bit. */
static void displace(const gait_tracker *t, const alignment *a, likelihood_scratch *w)
{
    int32_t const frames = t->model->frames, points = t->model->points;
    memcpy(w->home, w->body.o, (size_t)frames * sizeof *w->home);
    memcpy(w->home + frames, w->points, (size_t)points * sizeof *w->home);
    for (int32_t f = 0; f < frames + points; f++) {
        float (*const to)[BLOCK] = f < frames ? w->body.o[f] : w->points[f - frames];
        for (int32_t k = 0; k < 3; k++)
            for (int32_t i = 0; i < BLOCK; i++)
                to[k][i] += a->by[k][i];
    }
}

static void put_back(const gait_tracker *t, likelihood_scratch *w)
{
    int32_t const frames = t->model->frames, points = t->model->points;
    memcpy(w->body.o, w->home, (size_t)frames * sizeof *w->home);
    memcpy(w->points, w->home + frames, (size_t)points * sizeof *w->home);
}

/* ---- particles ---- */
/* The terms of particle i, which is in a lane of the projected block.  samples: receives its surface samples. */
static like_body evaluate(const gait_tracker *t, int32_t c, int32_t i, int32_t lane, likelihood_scratch *w,
                          like_patch *samples)
{
    like_patch *const texture = texture_of(t, i, c);
    like_body b = likelihood_body(t, c, hypothesis_of(t, i), lane, w, texture ? samples : NULL);
    b.ancestor = t->core->sampled_cameras >> c & 1u ? texture : NULL;
    like_evaluate(&b);
    return b;
}

/* The particles of a block in one camera.  kept: their samples replace those of their ancestors. */
static void particles_in_camera(gait_tracker *t, int32_t c, const int32_t *index, int32_t lanes, bool kept,
                                likelihood_scratch *w, float nats[BLOCK])
{
    like_patch samples[MODEL_MAX_LIMBS];
    alignment a;
    bool const aligned = align(t, c, w, &a);
    if (aligned)
        displace(t, &a, w);
    likelihood_outline(t, c, w);
    if (lanes < BLOCK) /* empty lanes are summed too: their sums are not used but must be defined */
        memset(&w->terms, 0, sizeof w->terms);
    for (int32_t lane = 0; lane < lanes; lane++) {
        int32_t const i = index[lane];
        like_body const b = evaluate(t, c, i, lane, w, samples);
        if (!kept)
            continue;
        t->explained[i] += like_silhouette_parts(&b).explained;
        if (texture_of(t, i, c))
            memcpy(texture_of(t, i, c), samples, (size_t)t->like->limbs * sizeof *samples);
    }
    like_sum(t->like, w->outline, t->core->sampled_cameras >> c & 1u, &w->terms, nats);
    if (aligned)
        put_back(t, w);
    for (int32_t lane = 0; lane < lanes && aligned; lane++)
        nats[lane] += a.nats[lane];
}

void likelihood_particles(gait_tracker *t, int32_t c, const int32_t *index, int32_t lanes,
                          likelihood_scratch *w, float nats[BLOCK])
{
    particles_in_camera(t, c, index, lanes, false, w, nats);
}

static void block_in_camera(gait_tracker *t, int32_t c, int32_t begin, int32_t lanes, likelihood_scratch *w)
{
    float nats[BLOCK];
    int32_t index[BLOCK];
    for (int32_t lane = 0; lane < lanes; lane++)
        index[lane] = begin + lane;
    particles_in_camera(t, c, index, lanes, true, w, nats);
    for (int32_t lane = 0; lane < lanes; lane++) {
        t->loglik_raw[begin + lane] += nats[lane];
        if (t->core->hypotheses.stage == HYPOTHESES_TWO)
            t->loglik_without_silhouette[begin + lane] += nats[lane] - w->terms.nats[LIKE_SILHOUETTE][lane];
    }
}

void joints_put(const gait_tracker *t, int32_t first, int32_t lanes, const likelihood_scratch *w)
{
    for (int32_t k = 0; k < 3 * t->model->points; k++)
        block_copy(t->joints.value + (size_t)k * (size_t)t->joints.most + first, w->points[k / 3][k % 3],
                   lanes);
}

static void likelihood_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    gait_tracker *const t = ctx;
    likelihood_scratch *const w = &t->work[task];
    for (int32_t first = begin; first < end; first += BLOCK) {
        int32_t const lanes = i_min(BLOCK, end - first);
        particle_set_bodies(layout_at(t, first), &t->particles, first, &w->body);
        kin_points(t->model, &w->body, w->points);
        if (t->cfg.particles <= t->joints.most)
            joints_put(t, first, lanes, w);
        for (int32_t i = first; i < first + lanes; i++)
            t->loglik_raw[i] = t->loglik_without_silhouette[i] = t->explained[i] = 0.0f;
        for (int32_t c = 0; c < t->cfg.cameras; c++)
            if (t->camera[c].features.has_image)
                block_in_camera(t, c, first, lanes, w);
    }
}

void likelihood_templates(gait_tracker *t)
{
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        for (int32_t h = 0; h < 2 && t->template_ring[h][c]; h++)
            template_ring(t->template[h][c], t->like->limbs, t->template_ring[h][c]);
}

void likelihood_step(gait_tracker *t)
{
    likelihood_templates(t);
    task_run(&t->cfg.exec, t->cfg.tasks, t->cfg.particles, BLOCK, likelihood_range, t);
}

/* ---- any body ---- */
COLD void likelihood_of_bodies(gait_tracker *t, int32_t n, like_patch *first, body_evidence *e)
{
    likelihood_scratch *const w = &t->work[0];
    memset(e, 0, (size_t)n * sizeof *e);
    if (t->cfg.terms & GAIT_TERM_KEYPOINTS)
        kin_points(t->model, &w->body, w->points);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        if (!t->camera[c].features.has_image)
            continue;
        likelihood_outline(t, c, w);
        for (int32_t lane = 0; lane < n; lane++) {
            like_patch *const samples = first && lane == 0 ? first + c * t->like->limbs : NULL;
            like_body const b = likelihood_body(t, c, 0, lane, w, samples);
            like_parts const parts = like_silhouette_parts(&b);
            e[lane].support += like_support(&b);
            if (t->cfg.terms & GAIT_TERM_KEYPOINTS)
                e[lane].by_keypoints += t->like->weight[LIKE_KEYPOINTS] * like_keypoints.support(&b);
            e[lane].parts.explained += parts.explained;
            e[lane].parts.missed += parts.missed;
            e[lane].chance += like_silhouette_chance(&b);
        }
    }
}

COLD body_evidence likelihood_of_particle(gait_tracker *t, const state_layout *of, const particle_state *p)
{
    body_evidence e;
    particle_body(of, p, &t->work[0].body);
    likelihood_of_bodies(t, 1, t->estimate_patch, &e);
    return e;
}

COLD uint32_t likelihood_sample(gait_tracker *t, const particle_state *p, like_patch *samples)
{
    likelihood_scratch *const w = &t->work[0];
    uint32_t cameras = 0;
    particle_body(&t->layout, p, &w->body);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        if (!t->camera[c].features.has_image)
            continue;
        likelihood_outline(t, c, w);
        likelihood_body(t, c, 0, 0, w, samples + c * t->like->limbs);
        cameras |= 1u << c;
    }
    return cameras;
}

COLD float likelihood_since(gait_tracker *t, const particle_state *p, uint32_t cameras,
                            const like_patch *then)
{
    likelihood_scratch *const w = &t->work[0];
    like_patch samples[MODEL_MAX_LIMBS];
    float sum = 0.0f;
    particle_body(&t->layout, p, &w->body);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        if (!t->camera[c].features.has_image || !(cameras >> c & 1u))
            continue;
        likelihood_outline(t, c, w);
        like_body b = likelihood_body(t, c, 0, 0, w, samples);
        b.ancestor = then + c * t->like->limbs;
        sum += like_texture.log_likelihood(&b);
    }
    return sum;
}

COLD float likelihood_of_keypoints(gait_tracker *t, const state_layout *of, const particle_state *p)
{
    likelihood_scratch *const w = &t->work[0];
    float sum = 0.0f;
    particle_body(of, p, &w->body);
    kin_points(t->model, &w->body, w->points);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        like_body const b = {.setup = t->like,
                             .features = &t->camera[c].features,
                             .camera = &t->cfg.camera[c],
                             .points = (const float (*)[3][BLOCK])w->points};
        sum += like_keypoints.support(&b);
    }
    return sum;
}
