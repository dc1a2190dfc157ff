/* How particles move: every field's mean and spread against closed forms. */
#include "kernel_check.h"
#include "toy_prior.h"
#include "toy_shifted.h"

#include "base/fmath.h"
#include "base/rng.h"

enum { FIELDS = F_COEF + 4 };

static void noisy(void)
{
    cfg.phase_noise = 0.02f;
    cfg.rate_noise = 0.02f;
    cfg.forward_noise = 0.022f;
    cfg.lateral_noise = 0.0164f;
    cfg.vertical_noise = 0.0096f;
    cfg.heading_noise = 0.044f;
    cfg.tilt_noise = 0.033f;
    cfg.coef_noise = 0.66f;
    cfg.stature_noise = 0.02f;
    cfg.stature_noise_start = 0.1f;
    cfg.proportion_noise = 0.3f;
    cfg.offset_noise = 0.4f;
}

/* ---- motion without noise ---- */

/* People who walk faster than the mean go further in a stride; in paper mode the stride is fixed. */
static void test_pace(void)
{
    const gait_model *const m = toy_shifted();
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++)
        for (int32_t sds = -3; sds <= 3; sds++) {
            dynamics d = quiet(mode, 1);
            d.rule.model = m;
            cfg.rate_time = 0.0f; /* the rate stays */
            particle_state w = {{[F_RATE] = m->stride_hz + (float)sds * m->stride_hz_sd, [F_STATURE] = 2.0f}};
            float const rate = w.f[F_RATE], clipped = f_clamp((float)sds, -2.0f, 2.0f);
            for (int32_t k = 0; k < 200; k++)
                w = move_one(&d, &w, 1.0f / (200.0f * rate), 1.0f, (uint32_t)k, 3);
            float const own = mode == GAIT_MODE_PAPER ? m->stride_length : 0.80f + 0.05f * clipped;
            CHECK_NEAR(w.f[F_X], 2.0f * own, 1e-3);
            CHECK_NEAR(state_layout_pace(&d.rule, rate), mode == GAIT_MODE_PAPER ? 0.0f : clipped, 1e-4);
        }
}

/* On a treadmill the belt cancels the progress of a stride. */
static void test_belt(void)
{
    const gait_model *const m = toy_model();
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++)
        for (int32_t half = 0; half <= 2; half++) {
            dynamics const d = quiet(mode, 1);
            particle_state w = {{[F_RATE] = m->stride_hz, [F_STATURE] = 1.8f, [F_HEADING] = 0.7f}};
            cfg.belt = 0.5 * half;
            for (int32_t k = 0; k < 100; k++)
                w = move_one(&d, &w, 0.01f / m->stride_hz, 1.0f, (uint32_t)k, 3);
            float const way = 1.8f * m->stride_length * (1.0f - (float)cfg.belt);
            CHECK_NEAR(w.f[F_X], way * cosf(0.7f), 0.01);
            CHECK_NEAR(w.f[F_Y], way * sinf(0.7f), 0.01);
        }
}

/* With the frames in reverse order a walk goes back to where it began, on a curve as well. */
static void test_reverse(void)
{
    const gait_model *const m = toy_model();
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++) {
        dynamics const d = quiet(mode, 1);
        particle_state const start = {{[F_PHASE] = 0.3f,
                                       [F_RATE] = m->stride_hz,
                                       [F_STATURE] = 1.8f,
                                       [F_HEADING] = 0.7f,
                                       [F_TURN] = 0.4f}};
        particle_state w = start;
        for (int32_t k = 0; k < 80; k++) {
            cfg.reverse = k >= 40;
            w = move_one(&d, &w, 0.01f, 1.0f, (uint32_t)k, 3);
            if (k == 39)
                CHECK(w.f[F_X] > 0.2f && w.f[F_HEADING] > 0.8f);
        }
        for (int32_t f = F_PHASE; f < F_COEF; f++)
            CHECK_NEAR(w.f[f], start.f[f], 2e-3);
    }
}

/* Phase, path and relaxing fields follow their equations. */
static void test_drift(void)
{
    const gait_model *const m = toy_model();
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++)
        for (int32_t steps = 12; steps <= 48; steps *= 2) {
            dynamics const d = quiet(mode, 1);
            float const dt = 1.2f / (float)steps, rate = m->stride_hz;
            particle_state w = {{0}};
            w.f[F_PHASE] = 0.9f;
            w.f[F_RATE] = rate;
            w.f[F_STATURE] = 1.8f;
            w.f[F_HEADING] = 0.7f;
            w.f[F_X] = 2.0f;
            w.f[F_Z] = 0.05f;
            w.f[F_PITCH] = 0.2f;
            w.f[F_ROLL] = -0.1f;
            w.f[F_COEF + 1] = 1.5f; /* the second component leaves the root alone */
            w.f[F_COEF + 2] = -0.7f;
            w.f[F_COEF + 3] = 0.04f;
            for (int32_t k = 0; k < steps; k++)
                w = move_one(&d, &w, dt, 1.0f, (uint32_t)k, 3);
            double path = 0.0; /* statures: integral of the forward motion over phase */
            for (int k = 0; k < 4000; k++)
                path += (double)root_channel(m, ROOT_FORWARD,
                                             (float)(0.9 + (double)rate * 1.2 * (k + 0.5) / 4000.0), 0.0f,
                                             w.f + F_COEF, 0) *
                        (double)rate * 1.2 / 4000.0;
            path = mode == GAIT_MODE_PAPER ? (double)m->stride_length * (double)rate * 1.2 : path;
            CHECK_NEAR(w.f[F_PHASE], fmod(0.9 + (double)rate * 1.2, 1.0), 1e-5);
            CHECK_NEAR(w.f[F_X], 2.0 + 1.8 * path * cos(0.7), 1e-3);
            CHECK_NEAR(w.f[F_Y], 1.8 * path * sin(0.7), 1e-3);
            CHECK(w.f[F_HEADING] == 0.7f && w.f[F_STATURE] == 1.8f && w.f[F_RATE] == rate);
            CHECK_NEAR(w.f[F_Z], 0.05 * exp(-1.2 / 1.1), 1e-6);
            CHECK_NEAR(w.f[F_PITCH], 0.2 * exp(-1.2 / 1.1), 1e-6);
            CHECK_NEAR(w.f[F_ROLL], -0.1 * exp(-1.2 / 1.1), 1e-6);
            CHECK_NEAR(w.f[F_COEF + 1], 1.5 * exp(-1.2 / 4.5), 1e-5);
            CHECK(w.f[F_COEF + 2] == -0.7f && w.f[F_COEF + 3] == 0.04f); /* without noise these stay */
        }
}

/* The rate returns to the mean of people, or never. */
static void test_rate(void)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 1);
    double const own = (double)toy_model()->stride_hz;
    for (int never = 0; never < 2; never++) {
        particle_state w = {.f = {[F_RATE] = 1.3f, [F_STATURE] = 1.7f}};
        cfg.rate_time = never ? 0.0f : 5.0f;
        for (uint32_t k = 0; k < 60; k++)
            w = move_one(&d, &w, 0.05f, 2.0f, k, 0);
        CHECK_NEAR(w.f[F_RATE], never ? 1.3 : own + (1.3 - own) * exp(-3.0 / 5.0), 1e-4);
    }
}

/* The phase advances by the rate before the step, whatever the new rate is (eq. 6). */
static void test_phase_of_rate_before(void)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 1);
    particle_state const from = {.f = {[F_PHASE] = 0.1f, [F_RATE] = 1.0f, [F_STATURE] = 1.7f}};
    cfg.rate_noise = 0.2f;
    for (int32_t i = 0; i < 5; i++) {
        particle_state const w = move_one(&d, &from, 0.25f, 2.0f, 0, i);
        CHECK(w.f[F_RATE] != 1.0f);
        CHECK_NEAR(w.f[F_PHASE], 0.35, 1e-6);
    }
}

/* Paper mode: the distance walked depends on the rate, not on the noise of the phase (eq. 8). */
static void test_paper_way(void)
{
    dynamics const d = quiet(GAIT_MODE_PAPER, 1);
    particle_state const from = {.f = {[F_RATE] = 1.0f, [F_STATURE] = 1.7f}};
    cfg.phase_noise = 0.05f;
    for (int32_t i = 0; i < 5; i++)
        CHECK_NEAR(move_one(&d, &from, 0.1f, 0.0f, 0, i).f[F_X], 1.7f * 0.80f * 0.1f, 1e-6);
}

/* ---- motion with noise ---- */

/* Fields of many particles after `seconds` in steps of dt; all start from the same state. */
static void sample_after(const dynamics *d, const particle_state *from, float dt, float seconds, float age,
                         double v[FIELDS][DRAWS])
{
    int32_t const steps = (int32_t)(seconds / dt + 0.5f);
    for (int32_t i = 0; i < DRAWS; i += BLOCK) {
        particle_state w[BLOCK];
        double cycles[BLOCK] = {0.0}; /* unwrapped phase */
        for (int32_t lane = 0; lane < BLOCK; lane++)
            w[lane] = *from;
        for (int32_t k = 0; k < steps; k++) {
            float before[BLOCK];
            for (int32_t lane = 0; lane < BLOCK; lane++)
                before[lane] = w[lane].f[F_PHASE];
            move_block(d, w, dt, age + (float)k * dt, (uint32_t)k, i);
            for (int32_t lane = 0; lane < BLOCK; lane++) {
                double const turn = (double)w[lane].f[F_PHASE] - (double)before[lane];
                cycles[lane] += turn - floor(turn + 0.5);
            }
        }
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            for (int f = 0; f < FIELDS; f++)
                v[f][i + lane] = (double)w[lane].f[f];
            v[F_PHASE][i + lane] = cycles[lane];
        }
    }
}

static particle_state standing(void)
{
    return (particle_state){.f = {[F_PHASE] = 0.2f, [F_RATE] = toy_model()->stride_hz, [F_STATURE] = 1.75f}};
}

static double sampled[2][FIELDS][DRAWS];

/* After a second: random walks t s^2, relaxing fields s^2 tau/2 (1 - exp(-2t/tau)), phase with its rate's integral. */
static void test_variances(void)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 9);
    particle_state const from = standing();
    double const T = 1.0, dt = 1.0 / 30.0, own = (double)toy_model()->stride_hz;
    noisy();
    cfg.settle_time = 0.0f;
    cfg.rate_time = 0.0f;
    sample_after(&d, &from, (float)dt, (float)T, 1.0f, sampled[0]);
    double const s = 0.02 * own, integral = s * s * T * T * T / 3.0 * (1.0 - 1.5 * dt / T);
    check_moments(moments_of(sampled[0][F_RATE], DRAWS), own, s * sqrt(T), DRAWS);
    check_moments(moments_of(sampled[0][F_PHASE], DRAWS), own * T, sqrt(0.02 * 0.02 * T + integral), DRAWS);
    check_moments(moments_of(sampled[0][F_HEADING], DRAWS), 0.0, 0.044 * sqrt(T), DRAWS);
    double const keep = 1.0 - exp(-2.0 * T / 1.1);
    check_moments(moments_of(sampled[0][F_PITCH], DRAWS), 0.0, 0.033 * sqrt(0.55 * keep), DRAWS);
    check_moments(moments_of(sampled[0][F_ROLL], DRAWS), 0.0, 0.033 * sqrt(0.55 * keep), DRAWS);
    check_moments(moments_of(sampled[0][F_Z], DRAWS), 0.0, 0.0096 * sqrt(0.55 * keep), DRAWS);
    double const coef = 0.66 * sqrt(2.25 * (1.0 - exp(-2.0 * T / 4.5)));
    check_moments(moments_of(sampled[0][F_COEF], DRAWS), 0.0, coef, DRAWS);
    check_moments(moments_of(sampled[0][F_COEF + 1], DRAWS), 0.0, coef, DRAWS);
    check_moments(moments_of(sampled[0][F_COEF + 2], DRAWS), 0.0, sqrt(1.0 - exp(-0.09 * T)), DRAWS);
    check_moments(moments_of(sampled[0][F_COEF + 3], DRAWS), 0.0, 0.05 * sqrt(1.0 - exp(-0.16 * T)),
                  DRAWS); /* as learnt */
    check_moments(moments_of(sampled[0][F_STATURE], DRAWS), 1.75, 1.75 * 0.05 * 0.02 * sqrt(T),
                  DRAWS);                                    /* settled */
    moments const side = moments_of(sampled[0][F_Y], DRAWS); /* lateral noise, and drifting headings */
    double const path = 1.75 * 0.8 * own, veer = path * 0.044;
    CHECK_NEAR(sqrt(side.var), sqrt(0.0164 * 0.0164 + veer * veer / 3.0), 0.0015);
    CHECK_NEAR(moments_of(sampled[0][F_X], DRAWS).mean, path, 0.02);
}

/* Forward noise is along the heading and lateral noise at right angles to it, whatever the heading (eq. 8). */
static void test_noise_follows_heading(void)
{
    static const float headings[] = {0.0f, 0.7f, 2.2f, -2.2f, -0.9f};
    for (size_t k = 0; k < 5; k++)
        for (int aside = 0; aside < 2; aside++) {
            dynamics const d = quiet(GAIT_MODE_DEFAULT, 20 + k);
            particle_state from = standing();
            from.f[F_HEADING] = headings[k];
            cfg.belt = 1.0; /* the walk itself goes nowhere */
            *(aside ? &cfg.lateral_noise : &cfg.forward_noise) = 0.02f;
            sample_after(&d, &from, 0.25f, 0.25f, 1.0f, sampled[0]);
            double const c = cos((double)headings[k]), s = sin((double)headings[k]);
            double off = 0.0;
            for (int i = 0; i < DRAWS; i++) {
                double const x = sampled[0][F_X][i], y = sampled[0][F_Y][i];
                off = fmax(off, fabs(aside ? x * c + y * s : y * c - x * s));
                sampled[1][F_X][i] = aside ? y * c - x * s : x * c + y * s;
            }
            CHECK_NEAR(off, 0.0, 1e-6);
            check_moments(moments_of(sampled[1][F_X], DRAWS), 0.0, 0.01, DRAWS);
        }
}

/* Relaxing fields end exactly at their stationary sd, at any frame rate; the start's rate noise is wider. */
static void test_stationary(void)
{
    static const float steps[] = {0.05f, 0.5f};
    for (size_t k = 0; k < 2; k++) {
        dynamics const d = quiet(GAIT_MODE_DEFAULT, 10 + k);
        particle_state const from = standing();
        noisy();
        cfg.tilt_time = 0.5f;
        cfg.coef_time = 0.6f;
        cfg.rate_time = 0.5f;
        cfg.offset_noise = 1.5f; /* time constant 0.89 s */
        cfg.proportion_noise = 1.5f;
        sample_after(&d, &from, steps[k], 4.0f, 9.0f, sampled[0]);
        check_moments(moments_of(sampled[0][F_PITCH], DRAWS), 0.0, 0.033 * sqrt(0.25), DRAWS);
        check_moments(moments_of(sampled[0][F_Z], DRAWS), 0.0, 0.0096 * sqrt(0.25), DRAWS);
        check_moments(moments_of(sampled[0][F_COEF], DRAWS), 0.0, 0.66 * sqrt(0.3), DRAWS);
        check_moments(moments_of(sampled[0][F_COEF + 2], DRAWS), 0.0, 1.0, DRAWS);
        check_moments(moments_of(sampled[0][F_COEF + 3], DRAWS), 0.0, 0.05, DRAWS);
        double const own = (double)toy_model()->stride_hz;
        check_moments(moments_of(sampled[0][F_RATE], DRAWS), own, 0.02 * own * sqrt(0.25), DRAWS);
    }
}

/* A very long time constant is a random walk. */
static void test_slow(void)
{
    static const float times[] = {0.0f, 1e6f, 1e4f, 100.0f};
    double var[4];
    particle_state const from = standing();
    for (size_t k = 0; k < 4; k++) {
        dynamics const d = quiet(GAIT_MODE_DEFAULT, 60);
        cfg.tilt_noise = 0.033f;
        cfg.tilt_time = times[k];
        sample_after(&d, &from, 0.04f, 0.2f, 9.0f, sampled[0]);
        var[k] = moments_of(sampled[0][F_PITCH], DRAWS).var;
        CHECK_NEAR(var[k] / var[0], 1.0, k == 3 ? 0.004 : 1e-4);
    }
    CHECK_NEAR(var[0], 0.033 * 0.033 * 0.2, 2e-5);
}

/* A second in 30, 15 or 3 frames is the same second. */
static void test_frame_rate(void)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 20);
    particle_state from = standing();
    noisy();
    cfg.settle_time = 9.0f;
    from.f[F_HEADING] = 0.5f;
    from.f[F_PITCH] = 0.1f;
    from.f[F_COEF] = 1.0f;
    sample_after(&d, &from, 1.0f / 30.0f, 1.0f, 0.0f, sampled[0]);
    for (int k = 0; k < 2; k++) {
        sample_after(&d, &from, k ? 1.0f / 3.0f : 1.0f / 15.0f, 1.0f, 0.0f, sampled[1]);
        for (int f = 0; f < FIELDS; f++) {
            moments const a = moments_of(sampled[0][f], DRAWS), b = moments_of(sampled[1][f], DRAWS);
            double const slack = f == F_X || f == F_Y || f == F_PHASE ? (k ? 0.35 : 0.07) : 0.0;
            double const lag =
                f == F_X || f == F_Y ? (k ? 0.02 : 0.004) : 0.0; /* metres: speed held for a step */
            CHECK_NEAR(b.mean, a.mean, 4.5 * sqrt(2.0 * a.var / DRAWS) + lag + 1e-5);
            CHECK_NEAR(b.var, a.var, a.var * (4.5 * sqrt(4.0 / DRAWS) + slack) + 1e-9);
        }
    }
}

/* Rates are reflected at the limits of people's range. */
static void test_reflect(void)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 30);
    int32_t wrong = 0, high = 0, low = 0;
    cfg.rate_time = 0.0f;
    cfg.rate_noise = 0.3f;
    for (int32_t i = 0; i < 500; i++) {
        particle_state w = {.f = {[F_RATE] = i % 2 ? 2.45f : 0.5f, [F_STATURE] = 1.7f}};
        for (uint32_t k = 0; k < 20; k++) {
            w = move_one(&d, &w, 0.1f, 2.0f, k, i);
            wrong += !(w.f[F_RATE] >= 1.0f / 2.1f && w.f[F_RATE] <= 2.5f);
            wrong += !(w.f[F_PHASE] >= 0.0f && w.f[F_PHASE] < 1.0f);
            high += w.f[F_RATE] == 2.5f;
            low += w.f[F_RATE] == 1.0f / 2.1f;
        }
    }
    CHECK(wrong == 0);
    CHECK(high < 10 && low < 10); /* reflected, not piled up at the limit */
}

/* Stature moves more while settling. */
static void test_settling(void)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 40);
    particle_state const from = standing();
    double const own = (double)toy_model()->stride_hz;
    noisy();
    cfg.rate_time = 0.0f;
    sample_after(&d, &from, 0.1f, 0.1f, 0.95f, sampled[0]);
    check_moments(moments_of(sampled[0][F_RATE], DRAWS), own, 0.02 * own * sqrt(0.1), DRAWS);
    check_moments(moments_of(sampled[0][F_STATURE], DRAWS), 1.75, 1.75 * 0.05 * 0.1 * sqrt(0.1), DRAWS);
    sample_after(&d, &from, 0.1f, 0.1f, 1.0f, sampled[0]);
    check_moments(moments_of(sampled[0][F_RATE], DRAWS), own, 0.02 * own * sqrt(0.1), DRAWS);
    check_moments(moments_of(sampled[0][F_STATURE], DRAWS), 1.75, 1.75 * 0.05 * 0.02 * sqrt(0.1), DRAWS);
}

/* Turn rates are kept for a while, then drawn anew, half of them 0, at any frame rate; but not during acquisition. */
static void test_turn_rates(void)
{
    static const float steps[] = {1.0f / 30.0f, 0.25f};
    double const kept = exp(-0.5), other = 0.5 * (1.0 - kept);
    for (size_t k = 0; k < 2; k++) {
        dynamics const d = quiet(GAIT_MODE_DEFAULT, 70 + k);
        particle_state from = standing();
        from.f[F_TURN] = cfg.turn_sd = 0.25f;
        cfg.turn_time = 2.0f;
        sample_after(&d, &from, steps[k], 1.0f, 0.1f, sampled[0]);
        double as_before = 0.0, straight = 0.0, square = 0.0;
        for (int i = 0; i < DRAWS; i++) {
            double const rate = sampled[0][F_TURN][i];
            as_before += rate == 0.25;
            straight += rate == 0.0;
            square += rate == 0.25 ? 0.0 : rate * rate / DRAWS;
        }
        CHECK_NEAR(as_before / DRAWS, kept, 2.25 / sqrt(DRAWS));
        CHECK_NEAR(straight / DRAWS, other, 2.25 / sqrt(DRAWS));
        CHECK_NEAR(square, other * 0.0625, 4.5 * 0.0625 * sqrt(3.0 * other / DRAWS));
        sample_after(&d, &from, steps[k], steps[k], 0.0f, sampled[0]);     /* one step, of age 0 */
        CHECK_NEAR(moments_of(sampled[0][F_TURN], DRAWS).var, 0.0, 1e-12); /* all as before */
    }
}

/* A person who turns walks on a circle. */
static void test_circle(void)
{
    dynamics d = quiet(GAIT_MODE_DEFAULT, 1);
    double const quarter = 1.57079632679490, rate = 0.5;
    for (int32_t steps = 20; steps <= 80; steps *= 2) {
        particle_state w = standing();
        w.f[F_TURN] = (float)rate;
        for (int32_t k = 0; k < steps; k++)
            w = move_one(&d, &w, (float)(quarter / rate) / (float)steps, 1.0f, (uint32_t)k, 3);
        CHECK_NEAR(w.f[F_HEADING], quarter, 1e-5);
        CHECK_NEAR(w.f[F_X] / w.f[F_Y], 1.0, 0.05); /* except for the speed within the stride */
        CHECK_NEAR(w.f[F_Y], 1.75 * 0.8 * (double)toy_model()->stride_hz / rate, 0.08);
    }
}

/* Noise of different fields, frames and particles is independent; the same arguments give the same. */
static void test_independent(void)
{
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 50), other = quiet(GAIT_MODE_DEFAULT, 51);
    particle_state const from = standing();
    noisy();
    sample_after(&d, &from, 0.04f, 0.04f, 0.0f, sampled[0]);
    for (int a = 0; a < FIELDS; a++)
        for (int b = 0; b < a; b++) {
            moments const x = moments_of(sampled[0][a], DRAWS), y = moments_of(sampled[0][b], DRAWS);
            double cov = 0.0;
            if ((a == F_X && b == F_PHASE) || x.var == 0.0 || y.var == 0.0)
                continue; /* a longer stride carries further */
            for (int i = 0; i < DRAWS; i++)
                cov += (sampled[0][a][i] - x.mean) * (sampled[0][b][i] - y.mean) / DRAWS;
            CHECK_NEAR(cov / sqrt(x.var * y.var), 0.0, 4.5 / sqrt(DRAWS));
        }
    particle_state const w = move_one(&d, &from, 0.04f, 0.0f, 3, 7);
    particle_state const same = move_one(&d, &from, 0.04f, 0.0f, 3, 7);
    particle_state const frame = move_one(&d, &from, 0.04f, 0.0f, 4, 7);
    particle_state const index = move_one(&d, &from, 0.04f, 0.0f, 3, 8);
    particle_state const seed = move_one(&other, &from, 0.04f, 0.0f, 3, 7);
    CHECK(memcmp(&w, &same, sizeof w) == 0);
    for (int f = 0; f < FIELDS; f++)
        CHECK(f == F_TURN || (w.f[f] != frame.f[f] && w.f[f] != index.f[f] && w.f[f] != seed.f[f]));
}

/* Every instruction set gives the same bits in every lane, and writes only existing fields. */
static void test_instruction_sets(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[2][sizeof(particle_block) + 2 * GUARD];
    static particle_block from;
    static const float extreme[] = {0.0f, -0.0f, 1e-30f, 0.999999f, -3.2f, 3.1415927f, 40.0f, -1e6f};
    for (uint32_t round = 0; round < 60; round++) {
        dynamics const d = quiet(round % 2 ? GAIT_MODE_PAPER : GAIT_MODE_DEFAULT, round);
        noisy();
        dynamics_step const s =
            dynamics_step_init(&d, 0.002f * (float)(1 + round), 0.03f * (float)round, round);
        for (uint32_t f = 0; f < (uint32_t)s.fields; f++)
            for (uint32_t lane = 0; lane < BLOCK; lane += 4) {
                float n[4];
                rng_normal4(7, 0, round, f, lane, n);
                for (uint32_t k = 0; k < 4; k++)
                    from.f[f][lane + k] =
                        (round + 3 * f + lane + k) % 9 == 0 ? extreme[(f + round) % 8] : n[k];
            }
        for (int k = -1; k < isa_count(); k++) {
            guarded const g = guard_fill(memory[k >= 0], sizeof(particle_block));
            const kernels *const run = k < 0 ? isa_scalar() : isa_at(k);
            run->dynamics_move(&s, (int32_t)(round * BLOCK), &from, (particle_block *)(void *)g.begin);
            CHECK(guard_whole(&g));
            CHECK(k < 0 || memcmp(memory[0], memory[1], sizeof memory[0]) == 0);
        }
    }
}

int main(void)
{
    test_drift();
    test_pace();
    test_belt();
    test_reverse();
    test_rate();
    test_phase_of_rate_before();
    test_paper_way();
    test_variances();
    test_noise_follows_heading();
    test_stationary();
    test_slow();
    test_frame_rate();
    test_reflect();
    test_turn_rates();
    test_circle();
    test_settling();
    test_independent();
    test_instruction_sets();
    return CHECK_DONE();
}
