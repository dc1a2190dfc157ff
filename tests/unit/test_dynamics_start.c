/* Where particles start: moments of every field, levels, and priors without phase or heading. */
#include "toy_prior.h"

#include "base/fmath.h"

enum {
    STATE_FIELDS = 12
}; /* phase, rate, stature, heading, pitch, roll, turn rate, pelvis x y, scores, offset */

static float *state_number(gait_state *s, size_t k)
{
    float *const at[] = {&s->phase,     &s->stride_hz, &s->stature,   &s->heading,
                         &s->pitch,     &s->roll,      &s->turn_rate, &s->pelvis[0],
                         &s->pelvis[1], &s->coef[0],   &s->coef[1],   &s->offset[OFFSET_ANGLE]};
    return at[k];
}

static void test_draw(void)
{
    static double v[STATE_FIELDS][DRAWS];
    static const float sds[] = {0.05f, 0.04f, 0.06f, 0.3f, 0.05f, 0.04f, 0.1f, 0.2f, 0.3f, 1.0f, 0.5f, 0.07f};
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 5);
    gait_state mean = toy_state(0.5f), sd = {0};
    mean.heading = 0.8f;
    mean.pitch = 0.1f;
    mean.roll = -0.05f;
    mean.pelvis[0] = 3.0f;
    mean.pelvis[1] = -2.0f;
    mean.coef[0] = 0.7f;
    mean.coef[1] = -1.1f;
    mean.offset[OFFSET_ANGLE] = 0.1f;
    for (size_t k = 0; k < STATE_FIELDS; k++)
        *state_number(&sd, k) = sds[k];
    sd.coef[5] = sd.offset[2] = 9.0f; /* not in use */
    for (int32_t i = 0; i < DRAWS; i++) {
        particle_state const w = dynamics_draw(&d, &mean, &sd, NULL, i);
        gait_state s = particle_to_state(&d.rule, &w);
        for (size_t k = 0; k < STATE_FIELDS; k++)
            v[k][i] = (double)*state_number(&s, k);
    }
    moments have[STATE_FIELDS];
    for (size_t k = 0; k < STATE_FIELDS; k++) {
        have[k] = moments_of(v[k], DRAWS);
        check_moments(have[k], (double)*state_number(&mean, k), (double)sds[k], DRAWS);
    }
    for (size_t a = 0; a < STATE_FIELDS; a++) /* independent */
        for (size_t b = 0; b < a; b++) {
            double cov = 0.0;
            for (int i = 0; i < DRAWS; i++)
                cov += (v[a][i] - have[a].mean) * (v[b][i] - have[b].mean) / DRAWS;
            CHECK_NEAR(cov / sqrt(have[a].var * have[b].var), 0.0, 4.5 / sqrt(DRAWS));
        }
}

/* With a standard deviation of 0 every particle is the mean, including the pelvis. */
static void test_draw_exact(void)
{
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++) {
        dynamics const d = quiet(mode, 5);
        gait_state mean = toy_state(0.3f);
        gait_state const sd = {0};
        mean.pelvis[2] += 0.13f;
        for (int32_t i = 0; i < 5; i++) {
            particle_state const w = dynamics_draw(&d, &mean, &sd, NULL, i);
            gait_state const s = particle_to_state(&d.rule, &w);
            CHECK(s.phase == mean.phase && s.stride_hz == mean.stride_hz && s.stature == mean.stature);
            for (int k = 0; k < 3; k++)
                CHECK_NEAR(s.pelvis[k], mean.pelvis[k], 1e-6);
        }
    }
}

/* Height: the given one and the ground at z = 0 (sd 3 cm) are combined. */
static void test_draw_level(void)
{
    static double v[DRAWS];
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 6);
    gait_state mean = toy_state(0.3f), sd = {.pelvis = {0, 0, 0.04f}};
    mean.pelvis[2] += 0.06f;
    for (int32_t i = 0; i < DRAWS; i++)
        v[i] = (double)dynamics_draw(&d, &mean, &sd, NULL, i).f[F_Z];
    double const trust = 0.0009 / (0.0009 + 0.0016);
    check_moments(moments_of(v, DRAWS), 0.06 * trust, sqrt(trust) * 0.04, DRAWS);
}

/* Unknown phase and heading are uniform over the circle; extreme rates and statures stay possible. */
static void test_draw_broad(void)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 7);
    gait_state mean = toy_state(0.3f),
               sd = {.phase = 0.5f, .heading = PI_F, .stride_hz = 2.0f, .stature = 2.0f};
    int32_t phase[16] = {0}, heading[16] = {0}, wrong = 0;
    double together = 0.0;
    for (int32_t i = 0; i < DRAWS; i++) {
        particle_state const w = dynamics_draw(&d, &mean, &sd, NULL, i);
        float const turn = m_wrap1(w.f[F_HEADING] / TWO_PI_F);
        wrong += !(w.f[F_PHASE] >= 0.0f && w.f[F_PHASE] < 1.0f);
        wrong += !(w.f[F_RATE] >= 0.476f && w.f[F_RATE] <= 2.5f && w.f[F_STATURE] >= 0.3f);
        phase[(int32_t)(16.0f * w.f[F_PHASE])]++;
        heading[(int32_t)(16.0f * turn)]++;
        together += cos(6.283185307 * (double)(w.f[F_PHASE] - turn)) / DRAWS;
    }
    CHECK(wrong == 0);
    double chi2[2] = {0.0, 0.0};
    for (int k = 0; k < 16; k++) {
        double const expect = DRAWS / 16.0;
        chi2[0] += (phase[k] - expect) * (phase[k] - expect) / expect;
        chi2[1] += (heading[k] - expect) * (heading[k] - expect) / expect;
    }
    CHECK_NEAR(together, 0.0, 4.5 / sqrt(2.0 * DRAWS));
    CHECK(chi2[0] < 37.7 && chi2[1] < 37.7); /* 15 degrees of freedom, p = 0.001 */
}

/* A start that does not state the turn rate: half of the people do not turn, others do; in paper mode none does. */
static void test_draw_turns(void)
{
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++) {
        dynamics const d = quiet(mode, 5);
        gait_state mean, sd;
        int32_t straight = 0, left = 0;
        CHECK(gait_tracker_prior(toy_model(), &mean, &sd, NULL) == GAIT_OK && sd.turn_rate == 0.25f);
        for (int32_t i = 0; i < 2000; i++) {
            float const turn = dynamics_draw(&d, &mean, &sd, NULL, i).f[F_TURN];
            straight += turn == 0.0f;
            left += turn > 0.1f;
        }
        bool const paper = mode == GAIT_MODE_PAPER;
        CHECK(straight >= (paper ? 2000 : 900) && straight < (paper ? 2001 : 1100));
        CHECK(paper ? left == 0 : left > 300 && left < 480);
    }
}

int main(void)
{
    test_draw();
    test_draw_turns();
    test_draw_exact();
    test_draw_level();
    test_draw_broad();
    return CHECK_DONE();
}
