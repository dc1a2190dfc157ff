/* Simulation-based calibration (Talts et al. 2018): a truth drawn from the filter's own
 * model ranks uniformly among draws of the posterior given its observations.  Here: a linear system. */
#include "toy_linear.h"

enum { RUNS = 500, DIM = 4, STEPS = 8, N = 1000 };

/* Chi square of every component's ranks; claimed: variance of the observations in the filter's likelihood. */
static void linear_ranks(double claimed, double chi2[DIM])
{
    static double value[TOY_MOST];
    int32_t count[DIM][RANKS] = {{0}};
    linear const s = linear_new(DIM, 0.25);
    linear assumed = s;
    assumed.R = claimed;
    for (uint64_t run = 0; run < RUNS; run++) {
        linear_world w = linear_start(&s, 3000 + run);
        linear_filter f = linear_filter_new(&assumed, N, 3000 + run);
        for (int t = 0; t < STEPS; t++) {
            linear_next(&w);
            linear_filter_step(&f, &w);
        }
        pf_resample_multinomial(&f.p, run, 9, 0);
        for (int k = 0; k < DIM; k++) {
            for (int32_t i = 0; i < f.p.n; i++)
                value[i] = (double)f.x[i][k];
            count[k][ranks_of(f.p.parent, value, w.truth[k])]++;
        }
    }
    for (int k = 0; k < DIM; k++)
        chi2[k] = ranks_chi2(count[k]);
}

/* Ranks are uniform, but not for a filter that trusts the observations twice as much as it should. */
static void test_linear(void)
{
    double right[DIM], wrong[DIM], worst = 0.0;
    linear_ranks(0.25, right);
    linear_ranks(0.25 / 4.0, wrong);
    for (int k = 0; k < DIM; k++) {
        CHECK(right[k] < RANKS_LIMIT);
        worst = fmax(worst, wrong[k]);
        FIGURE("C6 linear %d: chi square %.1f, overconfident %.1f\n", k, right[k], wrong[k]);
    }
    CHECK(worst > 2.0 * RANKS_LIMIT);
}

int main(void)
{
    test_linear();
    return CHECK_DONE();
}
