/* Mean and variance of the particle filter's core against a Kalman filter. */
#include "toy_linear.h"

enum { SEEDS = 20, STEPS = 50, FEW = 2000, MANY = 10000 };

/* The mean's error falls as 1 / sqrt(N) and is that of a correct filter (numpy twin: 6 .. 7 / sqrt(N));
 * the variance is right.  The slope is that of the mean logarithm: the mean square depends on a few
 * surprising observations. */
static void test_five(void)
{
    linear const s = linear_new(5, 0.2);
    double square = 0.0, variance = 0.0, slope = 0.0, spread = 0.0;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        linear_error const a = linear_run(linear_filter_new(&s, FEW, seed), STEPS);
        linear_error const b = linear_run(linear_filter_new(&s, MANY, seed), STEPS);
        double const own = 0.5 * (b.log_square - a.log_square) / log(MANY / (double)FEW);
        square += b.square / SEEDS;
        variance += b.variance / SEEDS;
        slope += own / SEEDS;
        spread += own * own / SEEDS;
    }
    double const error = sqrt((spread - slope * slope) / SEEDS);
    CHECK_NEAR(slope, -0.5, 3.0 * error);
    CHECK(error < 0.08);
    CHECK(sqrt(square) <= 0.08 && sqrt(square) >= 0.04);
    CHECK_NEAR(variance, 1.0, 0.03);
    FIGURE("K1 d = 5: slope %.3f +- %.3f, e(%d) %.4f; K2: variance %.4f\n", slope, error, MANY, sqrt(square),
           variance);
}

/* The same for one dimension, resampled in every step. */
static void test_one(void)
{
    linear const s = linear_new(1, 0.04);
    double square = 0.0, variance = 0.0;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        linear_filter f = linear_filter_new(&s, FEW, seed);
        f.resample_ess = 1.1;
        linear_error const e = linear_run(f, STEPS);
        square += e.square / SEEDS;
        variance += e.variance / SEEDS;
    }
    CHECK_NEAR(sqrt(square * FEW), 1.7, 0.4);
    CHECK_NEAR(variance, 1.0, 0.03);
    FIGURE("K1 d = 1: e sqrt N %.3f; K2: variance %.4f\n", sqrt(square * FEW), variance);
}

int main(void)
{
    test_five();
    test_one();
    return CHECK_DONE();
}
