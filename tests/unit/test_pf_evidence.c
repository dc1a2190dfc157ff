/* The evidence of the particle filter's core is unbiased: the mean of Z / Z_Kalman is 1 (Del Moral 2004). */
#include "toy_linear.h"

enum { RUNS = 200, STEPS = 20, N = 2000 };

/* Mean of exp(log Z - log Z_Kalman) within three standard errors of 1, resampling now and then and in
 * every step.  So few steps keep the standard deviation of its logarithm below 0.5 at this N. */
static void test_unbiased(void)
{
    static const double thresholds[] = {0.5, 1.1};
    linear const s = linear_new(5, 0.2);
    for (size_t k = 0; k < 2; k++) {
        double sum = 0.0, square = 0.0, log_sum = 0.0, log_square = 0.0;
        for (uint64_t seed = 1; seed <= RUNS; seed++) {
            linear_filter f = linear_filter_new(&s, N, 500 + seed);
            f.resample_ess = thresholds[k];
            double const l = linear_run(f, STEPS).evidence;
            sum += exp(l);
            square += exp(2.0 * l);
            log_sum += l;
            log_square += l * l;
        }
        double const mean = sum / RUNS, error = sqrt((square / RUNS - mean * mean) / RUNS);
        double const log_mean = log_sum / RUNS, sd = sqrt(log_square / RUNS - log_mean * log_mean);
        CHECK_NEAR(mean, 1.0, 3.0 * error);
        CHECK(error < 0.05);
        CHECK(sd <= 0.5);
        CHECK(log_mean <
              0.0); /* a mean of logarithms lies below the logarithm of the mean, by about sd^2 / 2 */
        CHECK_NEAR(log_mean, -0.5 * sd * sd, 4.0 * sd / sqrt(RUNS));
        FIGURE("K3: mean %.4f +- %.4f, logarithm %.3f +- %.3f\n", mean, error, log_mean, sd);
    }
}

int main(void)
{
    test_unbiased();
    return CHECK_DONE();
}
