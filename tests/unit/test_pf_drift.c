/* The library's own motion over many particles against closed forms within 2 %: phase and
 * rate, then every field that relaxes.  With 10^5 draws 2 % are 4.5 standard errors of a variance. */
#include "toy_filter.h"
#include "toy_prior.h"

enum { PARTICLES = 100000, FIELDS = F_COEF + 4 };

static double start[PARTICLES], turned[PARTICLES]; /* rate at the start; strides since */
static double value[FIELDS][PARTICLES];            /* at the end */

/* Move every particle from `from`, with its own rate at the start, `steps` times. */
static void move_all(const dynamics *d, const particle_state *from, float rate_sd, int32_t steps, float dt)
{
    for (int32_t i = 0; i < PARTICLES; i += BLOCK) {
        particle_state w[BLOCK];
        double turns[BLOCK] = {0.0};
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            float n[4];
            rng_normal4(31, 0, 0, (uint32_t)(i + lane), 0, n);
            w[lane] = *from;
            w[lane].f[F_RATE] += rate_sd * n[0];
            start[i + lane] = (double)w[lane].f[F_RATE];
        }
        for (int32_t k = 0; k < steps; k++) {
            float before[BLOCK];
            for (int32_t lane = 0; lane < BLOCK; lane++)
                before[lane] = w[lane].f[F_PHASE];
            move_block(d, w, dt, 100.0f, (uint32_t)k, i);
            for (int32_t lane = 0; lane < BLOCK; lane++) {
                double const turn = (double)w[lane].f[F_PHASE] - (double)before[lane];
                turns[lane] += turn - floor(turn + 0.5);
            }
        }
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            turned[i + lane] = turns[lane];
            for (int f = 0; f < FIELDS; f++)
                value[f][i + lane] = (double)w[lane].f[f];
        }
    }
}

static double covariance(const double *a, const double *b)
{
    double const ma = moments_of(a, PARTICLES).mean, mb = moments_of(b, PARTICLES).mean;
    double sum = 0.0;
    for (int i = 0; i < PARTICLES; i++)
        sum += (a[i] - ma) * (b[i] - mb) / PARTICLES;
    return sum;
}

static double worst; /* relative error of a variance */

/* Within 2 % of a variance and within 4.5 standard errors of a mean. */
static void check_law(const double *v, double mean, double var)
{
    moments const m = moments_of(v, PARTICLES);
    worst = fmax(worst, fabs(m.var / var - 1.0));
    CHECK_NEAR(m.mean, mean, 4.5 * sqrt(var / PARTICLES) + 1e-5);
    CHECK_NEAR(m.var / var, 1.0, 0.02);
}

static particle_state middle(void)
{
    return (particle_state){.f = {[F_PHASE] = 0.2f, [F_RATE] = toy_model()->stride_hz, [F_STATURE] = 1.75f}};
}

/* A rate that walks at random: the phase's variance is that of the integral, s^2 t^3 / 3 in the limit; a
 * step holds the rate it began with, so that n steps give s^2 dt^3 (n - 1) n (2 n - 1) / 6. */
static void test_integrated(void)
{
    enum { STEPS = 60 };
    dynamics const d = quiet(GAIT_MODE_DEFAULT, 71);
    particle_state const from = middle();
    double const dt = 1.0 / 30.0, n = STEPS, own = (double)toy_model()->stride_hz, s = 0.02 * own;
    cfg.rate_time = 0.0f;
    cfg.rate_noise = 0.02f;
    for (int noisy = 0; noisy < 2; noisy++) {
        double const phase = noisy ? 0.0164 : 0.0;
        double const integral = s * s * dt * dt * dt * (n - 1.0) * n * (2.0 * n - 1.0) / 6.0;
        cfg.phase_noise = (float)phase;
        move_all(&d, &from, 0.0f, STEPS, (float)dt);
        check_law(value[F_RATE], own, s * s * n * dt);
        check_law(turned, own * n * dt, phase * phase * n * dt + integral);
        CHECK_NEAR(integral / (s * s * pow(n * dt, 3.0) / 3.0), 1.0, 1.6 / STEPS);
        if (!noisy) /* s^2 t^2 / 2 */
            CHECK_NEAR(covariance(turned, value[F_RATE]) / (s * s * dt * dt * n * (n - 1.0) / 2.0), 1.0,
                       0.02);
    }
}

/* A rate that returns to the mean of people: it keeps its stationary variance, forgets as exp(-t / tau), and
 * the phase is its sum: Langevin's formula for steps. */
static void test_returning(void)
{
    enum { STEPS = 30 };
    static const float intervals[] = {1.0f / 30.0f, 1.0f / 6.0f};
    for (size_t k = 0; k < 2; k++) {
        dynamics const d = quiet(GAIT_MODE_DEFAULT, 72 + k);
        particle_state const from = middle();
        double const dt = (double)intervals[k], tau = 2.0, own = (double)toy_model()->stride_hz;
        double const var = 0.05 * 0.05 * own * own * tau / 2.0, keep = exp(-dt / tau);
        double sums = STEPS; /* sum over pairs of steps of keep^|i - j| */
        cfg.rate_time = (float)tau;
        cfg.rate_noise = 0.05f;
        move_all(&d, &from, (float)sqrt(var), STEPS, (float)dt);
        for (int lag = 1; lag < STEPS; lag++)
            sums += 2.0 * (STEPS - lag) * pow(keep, lag);
        check_law(value[F_RATE], own, var);
        check_law(turned, own * STEPS * dt, var * dt * dt * sums);
        CHECK_NEAR(covariance(start, value[F_RATE]) / var, pow(keep, STEPS), 0.015);
    }
}

/* A field that relaxes ends at noise^2 tau / 2, at any frame rate; proportions and posture at the standard deviations
 * given. */
static void test_stationary(void)
{
    static const float intervals[] = {0.25f, 1.0f};
    for (size_t k = 0; k < 2; k++) {
        dynamics const d = quiet(GAIT_MODE_DEFAULT, 74 + k);
        particle_state from = middle();
        double const own = (double)toy_model()->stride_hz;
        cfg.tilt_time = 0.8f;
        cfg.tilt_noise = 0.033f;
        cfg.vertical_noise = 0.0096f;
        cfg.coef_time = 0.6f;
        cfg.coef_noise = 0.66f;
        cfg.rate_time = 0.5f;
        cfg.rate_noise = 0.02f;
        cfg.proportion_noise = 1.5f; /* time constant 0.89 s */
        cfg.offset_noise = 1.5f;     /* 0.89 s */
        from.f[F_PITCH] = 0.1f;      /* forgotten after ten seconds */
        from.f[F_COEF] = 1.0f;
        move_all(&d, &from, 0.0f, (int32_t)(10.0f / intervals[k]), intervals[k]);
        check_law(value[F_RATE], own, 0.02 * 0.02 * own * own * 0.25);
        check_law(value[F_PITCH], 0.0, 0.033 * 0.033 * 0.4);
        check_law(value[F_ROLL], 0.0, 0.033 * 0.033 * 0.4);
        check_law(value[F_Z], 0.0, 0.0096 * 0.0096 * 0.4);
        check_law(value[F_COEF], 0.0, 0.66 * 0.66 * 0.3);
        check_law(value[F_COEF + 1], 0.0, 0.66 * 0.66 * 0.3);
        check_law(value[F_COEF + 2], 0.0, 1.0);
        check_law(value[F_COEF + 3], 0.0, 0.05 * 0.05);
    }
}

int main(void)
{
    test_integrated();
    test_returning();
    test_stationary();
    FIGURE("K6: variances within %.2f %% of the closed forms\n", 100.0 * worst);
    return CHECK_DONE();
}
