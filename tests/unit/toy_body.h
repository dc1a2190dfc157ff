/* toy_body.h - one camera's evidence of one body, without a tracker: for tests of the likelihood.
 *
 *   toy_body *v = toy_body_new(0, GAIT_MODE_DEFAULT);  camera 0 of the scene, all terms
 *   toy_body_aim(v, &state);                           region around a body
 *   toy_body_at(v, grey, wall);                        features of a frame; wall NULL: no plate
 *   like_body b = toy_body_body(v, &state);            outline, layers and surface samples, until the next call */
#ifndef TOY_BODY_H
#define TOY_BODY_H
#include "api/kernels.h"
#include "likelihood/likelihood.h"
#include "toy_draw.h"
#include "toy_features.h"
#include "toy_scene.h"

typedef struct toy_body {
    gait_tracker_config cfg;
    state_layout rule;
    like_setup setup;
    gait_camera cam;
    features f;
    features_scratch scratch;
    view_planes plate;
    kin_body body;
    outline_block outline;
    like_outline sides;
    like_pose pose;
    layers drawn;
    like_patch patch[TOY_LIMBS];
    like_block terms;
} toy_body;

static inline toy_body *toy_body_new(int camera, int32_t mode)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[4 << 20];
    static toy_body v;
    arena a = {.base = memory, .cap = sizeof memory};
    gait_tracker_default(&v.cfg, (gait_mode)mode);
    v.cfg.occluded_density = 0.0018f; /* not the defaults, which may change */
    v.cfg.surface_sd = 8.0f;
    v.cfg.surface_tilt = 1.0f;
    v.cfg.limb_points = 16;
    v.cfg.components = TOY_COMPONENTS;
    v.cfg.offset_angles = 1u << (TOY_TORSO + 1);
    v.cfg.terms = 0xf;
    v.cfg.girth = 1.0f;
    v.cfg.missed_weight = 0.4f;
    v.rule = state_layout_init(toy_model(), &v.cfg, kernels_choose(~0u));
    v.rule.plain_root = false; /* the truth sways */
    v.cam = toy_camera(camera);
    v.f = features_layout(&a);
    v.scratch = features_scratch_layout(&a);
    v.plate = view_planes_layout(&a, 3);
    v.f.map = (view_map){.scale = 1.4f, .u0 = 100.0f, .v0 = 60.0f};
    if (a.overflow)
        abort();
    like_setup_init(&v.setup, toy_model(), &v.cfg, kernels_choose(~0u));
    return &v;
}

/* Aim the region at a body's pelvis. */
static inline void toy_body_aim(toy_body *v, const gait_state *s)
{
    float uv[2] = {0};
    camera_project(&v->cam, s->pelvis, uv);
    v->f.map = (view_map){.scale = 1.4f, .u0 = uv[0] - 91.0f, .v0 = uv[1] - 91.0f};
}

static inline void toy_body_at(toy_body *v, const uint8_t *grey, const uint8_t *wall)
{
    gait_image const im = toy_image(grey);
    if (wall) {
        gait_image const empty = toy_image(wall);
        view_sample(v->setup.run, &v->f.map, &v->cam, &empty, &v->plate);
    }
    toy_features(v->setup.run, &v->f, &v->cam, &im, wall ? &v->plate : NULL, v->setup.paper, &v->scratch);
}

static inline like_body toy_body_body(toy_body *v, const gait_state *s)
{
    enum { LANE = 5 };
    particle_state const w = particle_from_state(&v->rule, s);
    particle_body(&v->rule, &w, &v->body);
    toy_project(v->setup.geometry, v->setup.limbs, &v->body, &v->cam, &v->f.map, &v->outline);
    toy_draw(&v->outline, v->setup.geometry, v->setup.limbs, LANE, &v->drawn);
    v->setup.run->edges_prepare(&v->outline, v->setup.geometry, v->setup.limbs, &v->sides);
    v->setup.run->surface_pose(&v->setup, &v->cam, &v->f.map, &v->body, &v->pose);
    v->setup.run->surface_sample(&v->setup, &v->f, &v->pose, LANE, &v->drawn, v->patch);
    like_body b = {.setup = &v->setup,
                   .features = &v->f,
                   .outline = &v->outline,
                   .sides = &v->sides,
                   .lane = LANE,
                   .layers = &v->drawn,
                   .samples = v->patch,
                   .terms = &v->terms};
    like_silhouette_count(&b);
    return b;
}

/* Sum of the weighted terms of one body. */
static inline float toy_likelihood(const like_body *b)
{
    float sum[BLOCK];
    memset(b->terms, 0, sizeof *b->terms);
    like_evaluate(b);
    like_sum(b->setup, b->outline, b->ancestor, b->terms, sum);
    return sum[b->lane];
}
#endif
