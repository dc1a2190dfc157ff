#include "tracker/likelihood_step.h"
#include "likelihood/likelihood.h"
#include <stddef.h>
#include <string.h>

void likelihood_scratch_layout(arena *a, const gait_model *m, likelihood_scratch *w)
{
    size_t const limbs = (size_t)m->limbs;
    void *const outline = arena_take(a, sizeof(outline_lanes), limbs);
    void *const lines = arena_take(a, offsetof(layers_block, limb) + limbs * sizeof(layers_limb), 1);
    void *const sides = arena_take(a, sizeof(like_sides), limbs);
    void *const pose = arena_take(a, sizeof(like_pose_limb), limbs);
    void *const drawn = arena_take(a, offsetof(layers, visible) + limbs * sizeof(grid_mask), 1);
    void *const points = arena_take(a, sizeof *w->points, (size_t)m->points);
    if (!w)
        return;
    w->outline = outline;
    w->lines = lines;
    w->sides = sides;
    w->pose = pose;
    w->layers = drawn;
    w->points = points;
}

/* The block's limbs in one camera, and in its working image and grid. */
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

/* One body of a block in one camera, ready for the terms. */
like_body likelihood_body(const gait_tracker *t, int32_t c, int32_t side, int32_t lane, likelihood_scratch *w,
                     like_patch *seen)
{
    like_body b = {.setup = t->like,
                   .features = &t->camera[c].features,
                   .outline = w->outline,
                   .sides = w->sides,
                   .lane = lane,
                   .layers = w->layers,
                   .samples = seen,
                   .camera = &t->cfg.camera[c],
                   .points = (const float (*)[3][BLOCK])w->points,
                   .terms = &w->terms,
                   .known = t->known[side][c]};
    t->like->run->layers_draw(w->lines, lane, w->layers);
    if (seen)
        like_sample(t->like, b.features, w->pose, lane, w->layers, seen);
    like_silhouette_count(&b);
    return b;
}

like_patch *texture_of(const gait_tracker *t, int32_t i, int32_t c)
{
    size_t const at = ((size_t)i * (size_t)t->cfg.cameras + (size_t)c) * (size_t)t->like->limbs;
    return t->texture ? t->texture + at : NULL;
}

/* One particle of a block in one camera.  What it sees takes the place of what its ancestor saw. */
static void likelihood_one(gait_tracker *t, int32_t c, int32_t i, int32_t lane, likelihood_scratch *w)
{
    like_patch seen[MODEL_MAX_LIMBS], *const texture = texture_of(t, i, c);
    like_body b = likelihood_body(t, c, hypothesis_of(t, i), lane, w, texture ? seen : NULL);
    b.ancestor = t->core->textured >> c & 1u ? texture : NULL;
    like_evaluate(&b);
    t->loglik[i] += like_silhouette_parts(&b).explained;
    if (texture)
        memcpy(texture, seen, (size_t)t->like->limbs * sizeof *seen);
}

/* The particles of a block in one camera. */
static void likelihood_view(gait_tracker *t, int32_t c, int32_t begin, int32_t lanes, likelihood_scratch *w)
{
    float ll[BLOCK];
    likelihood_outline(t, c, w);
    if (lanes < BLOCK) /* those without a particle are summed as well, though nobody reads what comes of it */
        memset(&w->terms, 0, sizeof w->terms);
    for (int32_t lane = 0; lane < lanes; lane++)
        likelihood_one(t, c, begin + lane, lane, w);
    like_sum(t->like, w->outline, t->core->textured >> c & 1u, &w->terms, ll);
    for (int32_t lane = 0; lane < lanes; lane++) {
        t->loglik_raw[begin + lane] += ll[lane];
        if (t->core->hypotheses.stage == HYPOTHESES_TWO)
            t->loglik_without_silhouette[begin + lane] += ll[lane] - w->terms.nats[LIKE_SILHOUETTE][lane];
    }
}

static void likelihood_block(gait_tracker *t, int32_t begin, int32_t lanes, likelihood_scratch *w)
{
    int32_t const n = t->cfg.particles;
    particle_set_bodies(&t->rule, &t->particles, begin, &w->body);
    kin_points(t->model, &w->body, w->points);
    for (int32_t p = 0; p < t->model->points; p++)
        for (int32_t k = 0; k < 3; k++)
            block_copy(t->joint + (size_t)(3 * p + k) * (size_t)n + (size_t)begin, w->points[p][k], lanes);
    for (int32_t lane = 0; lane < lanes; lane++)
        t->loglik_raw[begin + lane] = t->loglik_without_silhouette[begin + lane] = t->loglik[begin + lane] = 0.0f;
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        if (t->camera[c].features.has_image)
            likelihood_view(t, c, begin, lanes, w);
}

static void likelihood_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    gait_tracker *const t = ctx;
    for (int32_t i = begin; i < end; i += BLOCK)
        likelihood_block(t, i, i_min(BLOCK, end - i), &t->work[task]);
}

void likelihood_step(gait_tracker *t)
{
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        for (int32_t side = 0; side < 2 && t->known[side][c]; side++)
            template_ring(t->template[side][c], t->like->limbs, t->known[side][c]);
    task_run(&t->cfg.exec, t->cfg.tasks, t->cfg.particles, BLOCK, likelihood_range, t);
}

likelihood_verdict likelihood_of_particle(gait_tracker *t, const particle_state *person)
{
    likelihood_scratch *const w = &t->work[0];
    likelihood_verdict sight = {.support = 0.0f};
    particle_body(&t->rule, person, &w->body);
    if (t->cfg.terms & GAIT_TERM_KEYPOINTS)
        kin_points(t->model, &w->body, w->points);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        if (!t->camera[c].features.has_image)
            continue;
        likelihood_outline(t, c, w);
        like_patch *const seen = t->estimate_patch ? t->estimate_patch + c * t->like->limbs : NULL;
        like_body const b = likelihood_body(t, c, 0, 0, w, seen);
        like_parts const parts = like_silhouette_parts(&b);
        sight.support += like_support(&b);
        sight.parts.explained += parts.explained;
        sight.parts.missed += parts.missed;
    }
    return sight;
}
