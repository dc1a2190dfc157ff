/* Particles as fields: conversion to states and back, and their bodies against the kinematics of those states. */
#include "api/kernels.h"
#include "filter/particles.h"

#include "base/rng.h"
#include "toy_model.h"

#include "check.h"

static state_layout make_rule(int32_t mode, int32_t components, uint32_t offsets)
{
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, (gait_mode)mode);
    cfg.components = components;
    cfg.offset_angles = offsets;
    cfg.proportions = mode == GAIT_MODE_PAPER ? 0 : -1;
    return state_layout_init(toy_model(), &cfg, kernels_choose(~0u));
}

static gait_state random_state(const state_layout *r, uint32_t i)
{
    float u[4], x[4], y[4];
    rng_uniform4(3, 0, 0, i, 0, u);
    rng_normal4(3, 1, 0, i, 0, x);
    rng_normal4(3, 2, 0, i, 0, y);
    gait_state s = {.phase = u[0],
                    .stride_hz = 0.7f + 0.5f * u[1],
                    .stature = 1.5f + 0.4f * u[2],
                    .heading = 6.0f * (u[3] - 0.5f),
                    .pitch = 0.1f * x[0],
                    .roll = 0.1f * x[1],
                    .pelvis = {3.0f * x[2], 3.0f * x[3], 0.9f + 0.1f * y[0]}};
    for (int32_t k = 0; k < r->components; k++)
        s.coef[k] = y[1 + k];
    for (int32_t k = 0; k < r->proportions; k++)
        s.proportion[k] = x[2 + k];
    for (int32_t k = 0; k < r->offsets; k++)
        s.offset[r->angle[k]] = 0.1f * y[3] * (float)(k + 1);
    return s;
}

static void test_rule(void)
{
    state_layout const r = make_rule(GAIT_MODE_DEFAULT, 1, 1u << 5 | 1u << 0 | 1u << 20 | 1u << 31);
    CHECK(r.components == 1 && !r.plain_root && r.model == toy_model());
    CHECK(r.offsets == 3 && r.angle[0] == 0 && r.angle[1] == 5 && r.angle[2] == 20); /* the model has no 31 */
    CHECK(state_layout_fields(&r) == F_COEF + 1 + TOY_PROPORTIONS + 3);
    double mean = 0.0;
    for (int j = 0; j < TOY_PHASES; j++)
        mean += (double)toy_model()->curves[j * TOY_CHANNELS + TOY_ROOT + ROOT_HEIGHT] / TOY_PHASES;
    CHECK_NEAR(r.mean_height, mean, 1e-6);
    CHECK(make_rule(GAIT_MODE_PAPER, 0, 0).plain_root);
}

static void test_the_default_mode_uses_the_first_four_components_paper_mode_all(void)
{
    gait_model m = *toy_model();
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++) {
        gait_tracker_config cfg;
        gait_tracker_default(&cfg, (gait_mode)mode);
        for (m.components = 0; m.components <= 8; m.components++)
            CHECK(state_layout_init(&m, &cfg, kernels_choose(~0u)).components ==
                  (mode == GAIT_MODE_PAPER || m.components < 5 ? m.components : 5));
        cfg.components = m.components = 8;
        CHECK(state_layout_init(&m, &cfg, kernels_choose(~0u)).components == 8);
    }
}

static void test_round_trip(void)
{
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++) {
        state_layout const r = make_rule(mode, mode ? 1 : 2, mode ? 0 : 1u << 19 | 1u << 3);
        for (uint32_t i = 0; i < 50; i++) {
            gait_state const s = random_state(&r, i);
            particle_state const w = particle_from_state(&r, &s);
            gait_state const back = particle_to_state(&r, &w);
            for (int k = 0; k < 3; k++)
                CHECK_NEAR(back.pelvis[k], s.pelvis[k], 1e-6);
            CHECK(back.phase == s.phase && back.stride_hz == s.stride_hz && back.stature == s.stature);
            CHECK(back.heading == s.heading && back.pitch == s.pitch && back.roll == s.roll);
            CHECK(memcmp(back.coef, s.coef, sizeof s.coef) == 0);
            CHECK(memcmp(back.offset, s.offset, sizeof s.offset) == 0);
            particle_state const again = particle_from_state(&r, &back);
            for (int f = 0; f < state_layout_fields(&r); f++)
                CHECK_NEAR(again.f[f], w.f[f], 1e-6);
        }
    }
    state_layout const r = make_rule(GAIT_MODE_DEFAULT, 0, 0);
    gait_state s = random_state(&r, 1);
    s.phase = -0.25f;
    CHECK(particle_from_state(&r, &s).f[F_PHASE] == 0.75f);
}

/* The track is straight and level where the pelvis sways and bobs. */
static void test_track(void)
{
    state_layout const r = make_rule(GAIT_MODE_DEFAULT, 0, 0), plain = make_rule(GAIT_MODE_PAPER, 0, 0);
    particle_state w = {{0}};
    w.f[F_STATURE] = 2.0f;
    w.f[F_X] = 3.0f;
    w.f[F_Y] = -1.0f;
    w.f[F_Z] = 0.1f;
    w.f[F_HEADING] = 0.5f * PI_F; /* along +y: sway to the left is -x */
    double most = 0.0;
    for (int j = 0; j < TOY_PHASES; j++) {
        const float *const root = toy_model()->curves + j * TOY_CHANNELS + TOY_ROOT;
        w.f[F_PHASE] = (float)j / TOY_PHASES;
        gait_state const s = particle_to_state(&r, &w), p = particle_to_state(&plain, &w);
        CHECK_NEAR(s.pelvis[0], 3.0f - 2.0f * root[ROOT_SWAY], 1e-6);
        CHECK_NEAR(s.pelvis[1], -1.0, 1e-6);
        CHECK_NEAR(s.pelvis[2], 0.1f + 2.0f * root[ROOT_HEIGHT], 1e-6);
        CHECK_NEAR(p.pelvis[0], 3.0, 1e-6);
        CHECK_NEAR(p.pelvis[2], 0.1f + 2.0f * r.mean_height, 1e-6);
        most = fmax(most, fabs((double)root[ROOT_SWAY]));
    }
    CHECK(most > 0.005);
}

static void test_root_channel(void)
{
    const gait_model *const m = toy_model();
    for (uint32_t i = 0; i < 60; i++) {
        state_layout const r = make_rule(GAIT_MODE_DEFAULT, 2, 0);
        gait_state const s = random_state(&r, i);
        kin_input filled = {0};
        static kin_channels ch;
        filled.phase[0] = i < 3 ? 0.999999f : s.phase;
        filled.coef[0][0] = s.coef[0];
        filled.coef[1][0] = s.coef[1];
        for (int32_t q = 0; q <= 2; q++) {
            r.run->kin_curves(m, &filled, q, &ch);
            for (int32_t c = ROOT_FORWARD; c <= ROOT_YAW; c++) {
                float const want = ch.v[m->root_channel + c][0];
                CHECK_NEAR(root_channel(m, c, filled.phase[0], 0.0f, s.coef, q), want, 1e-6);
                CHECK_NEAR(root_channel(m, c, filled.phase[0] - 7.0f, 0.0f, s.coef, q), want, 1e-5);
            }
        }
    }
    CHECK(isfinite(root_channel(m, ROOT_HEIGHT, NAN, 0.0f, NULL, 0)));
}

/* Bodies of a particle set are those of the particles' states, and the tail repeats the last. */
static void test_bodies(void)
{
    enum { N = 21 };
    static float value[F_MAX * N];
    static kin_body body, single;
    const gait_model *const m = toy_model();
    state_layout const r = make_rule(GAIT_MODE_DEFAULT, 2, 1u << 19 | 1u << 9);
    particle_set p = {.n = N, .fields = state_layout_fields(&r), .value = value};
    for (uint32_t i = 0; i < N; i++) {
        gait_state const s = random_state(&r, i);
        particle_state const w = particle_from_state(&r, &s);
        particle_put(&p, (int32_t)i, &w);
    }
    CHECK(field(&p, F_STATURE)[7] == random_state(&r, 7).stature);
    double turn = 0.0, place = 0.0;
    int32_t same = 1;
    for (int32_t begin = 0; begin < N; begin += BLOCK) {
        particle_set_bodies(&r, &p, begin, &body);
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            int32_t const i = i_min(begin + lane, N - 1);
            gait_state const s = random_state(&r, (uint32_t)i);
            kin_frames at;
            CHECK(model_place_state(m, &s, &at) == GAIT_OK);
            for (int f = 0; f < m->frames; f++) {
                for (int k = 0; k < 9; k++)
                    turn = fmax(turn, fabs((double)(at.R[9 * f + k] - body.R[f][k][lane])));
                for (int k = 0; k < 3; k++)
                    place = fmax(place, fabs((double)(at.o[3 * f + k] - body.o[f][k][lane])));
            }
            for (int f = 0; f < m->frames; f++)
                CHECK_NEAR(body.scale[f][lane], at.scale[f], 1e-6);
            particle_state const w = particle_get(&p, i);
            particle_body(&r, &w, &single);
            for (int k = 0; k < 3; k++)
                same &= single.o[5][k][3] == body.o[5][k][lane] &&
                        single.o[5][k][BLOCK - 1] == body.o[5][k][lane];
        }
    }
    CHECK_NEAR(turn, 0.0, 1e-5);
    CHECK_NEAR(place, 0.0, 1e-5);
    CHECK(same);
}

/* Paper mode: the pelvis has only the state's own tilt, and stays at its mean height. */
static void test_plain_body(void)
{
    static kin_body body;
    state_layout const r = make_rule(GAIT_MODE_PAPER, 0, 0);
    for (int j = 0; j < 10; j++) {
        particle_state w = {{0}};
        w.f[F_PHASE] = 0.1f * (float)j;
        w.f[F_STATURE] = 1.5f;
        w.f[F_PITCH] = 0.2f;
        particle_body(&r, &w, &body);
        CHECK_NEAR(body.o[0][2][0], 1.5f * r.mean_height, 1e-6);
        CHECK(body.o[0][0][0] == 0.0f && body.o[0][1][0] == 0.0f);
        const double want[9] = {cos(0.2), 0, sin(0.2), 0, 1, 0, -sin(0.2), 0, cos(0.2)};
        for (int k = 0; k < 9; k++)
            CHECK_NEAR(body.R[0][k][0], want[k], 1e-6);
    }
}

int main(void)
{
    test_rule();
    test_the_default_mode_uses_the_first_four_components_paper_mode_all();
    test_round_trip();
    test_track();
    test_root_channel();
    test_bodies();
    test_plain_body();
    return CHECK_DONE();
}
