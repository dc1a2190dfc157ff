/* Thirteen dimensions and sharp observations: particles proposed blindly, and by a guided proposal whose
 * weights are p(y | x') p(x' | x) / q(x' | x, y) (Doucet et al. 2000). */
#include "toy_linear.h"

enum { DIM = 13, SEEDS = 4, STEPS = 50, N = 10000 };

/* The locally optimal proposal N(A x + K (y - H A x), P), P = Q - K H Q; its weight is p(y | x). */
typedef struct guide {
    double K[DIM][DIM], root[DIM][DIM]; /* root root' = P, lower */
    double log_norm;                    /* log density of N(0, H Q H' + R) at 0 */
} guide;

static guide make_guide(const linear *s)
{
    guide u = {.log_norm = 0.0};
    gauss g = {.mean = {0}};
    double const none[DIM] = {0};
    for (int i = 0; i < DIM; i++)
        g.cov[i][i] = s->Q[i];
    u.log_norm = kalman_update(s, &g, none); /* observing 0 of N(0, Q): cov becomes P */
    for (int i = 0; i < DIM; i++)
        for (int j = 0; j < DIM; j++) {
            double rest = g.cov[i][j];
            for (int k = 0; k < DIM; k++)
                u.K[i][j] += g.cov[i][k] * s->H[j][k] / s->R; /* K = P H' / R */
            for (int k = 0; k < j; k++)
                rest -= u.root[i][k] * u.root[j][k];
            if (j <= i) /* Cholesky, row by row */
                u.root[i][j] = i == j ? sqrt(rest) : rest / u.root[j][j];
        }
    return u;
}

/* miss' (H Q H' + R)^-1 miss = miss' (miss - H K miss) / R. */
static double propose(const linear *s, const void *rule, const double *y, const float *from, const float *z,
                      float *to)
{
    const guide *const u = rule;
    double ahead[DIM], miss[DIM], shift[DIM] = {0}, square = 0.0;
    for (int i = 0; i < DIM; i++)
        ahead[i] = s->A[i] * (double)from[i];
    for (int i = 0; i < DIM; i++) {
        miss[i] = y[i];
        for (int j = 0; j < DIM; j++)
            miss[i] -= s->H[i][j] * ahead[j];
    }
    for (int i = 0; i < DIM; i++) {
        double noise = 0.0;
        for (int j = 0; j < DIM; j++)
            shift[i] += u->K[i][j] * miss[j];
        for (int j = 0; j <= i; j++)
            noise += u->root[i][j] * (double)z[j];
        to[i] = (float)(ahead[i] + shift[i] + noise);
    }
    for (int i = 0; i < DIM; i++) {
        double left = miss[i];
        for (int j = 0; j < DIM; j++)
            left -= s->H[i][j] * shift[j];
        square += miss[i] * left / s->R;
    }
    return u->log_norm - 0.5 * square;
}

static void test_guided(void)
{
    linear const s = linear_new(DIM, 0.04);
    guide const u = make_guide(&s);
    linear_error blind = {0}, guided = {0};
    double widest = 0.0, least = 1e9;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        linear_filter f = linear_filter_new(&s, N, seed);
        linear_error const a = linear_run(f, STEPS);
        f = linear_filter_new(&s, N, seed);
        f.move = propose;
        f.rule = &u;
        linear_error const b = linear_run(f, STEPS);
        blind.square += a.square / SEEDS;
        guided.square += b.square / SEEDS;
        blind.ess += a.ess / SEEDS;
        guided.ess += b.ess / SEEDS;
        guided.variance += b.variance / SEEDS;
        widest = fmax(widest, fabs(b.evidence));
        least = fmin(least, fabs(a.evidence));
    }
    FIGURE("K4: blind e %.3f, ESS %.4f; guided e %.3f, ESS %.3f, variance %.3f\n", sqrt(blind.square),
           blind.ess, sqrt(guided.square), guided.ess, guided.variance);
    FIGURE("K4: log evidence off by up to %.2f guided, by %.1f or more blind\n", widest, least);
    CHECK(sqrt(guided.square) <= 0.25);
    CHECK(guided.ess >= 0.15);
    CHECK_NEAR(guided.variance, 1.0, 0.05);
    CHECK(widest < 5.0 && least > 10.0);
    CHECK(sqrt(blind.square) > 2.0 * sqrt(guided.square)); /* why guidance is wanted */
    CHECK(blind.ess < 0.02);
}

int main(void)
{
    test_guided();
    return CHECK_DONE();
}
