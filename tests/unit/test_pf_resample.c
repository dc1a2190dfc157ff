/* Resampling: statistics of the counts and what they do to a mean (Douc et al. 2005). */
#include "toy_filter.h"

enum { N = 100, KINDS = 3 };

/* Weights of the given kind; normalised.  EXTREME spans 20 bits. */
enum { SMOOTH, EXTREME, ROUGH };
static pf weighted(int32_t n, int kind)
{
    pf p = toy_filter(n);
    float ll[TOY_MOST];
    for (int32_t i = 0; i < n; i++) {
        float const x = (float)i / (float)n, u = toy_uniform(21, (uint32_t)i, 1);
        ll[i] = kind == SMOOTH  ? -8.0f * (x - 0.4f) * (x - 0.4f)
                : kind == ROUGH ? logf(u + 0.01f)
                                : -14.0f * u;
    }
    CHECK(!pf_update(&p, ll).degenerate);
    return p;
}

typedef struct counts { /* of the children of every particle, over many resamplings */
    double weight[N], mean[N], square[N];
    double worst;     /* largest |count - children weight| of any */
    int32_t disorder; /* parents that are not in order */
} counts;

/* `children` 0: multinomial draws of N; else systematic ones of so many. */
static counts count_children(int kind, uint32_t draws, int32_t children)
{
    pf p = weighted(N, kind);
    counts c = {.worst = 0.0};
    memcpy(c.weight, p.weight, sizeof c.weight);
    for (uint32_t d = 0; d < draws; d++) {
        int32_t count[N] = {0};
        p.n = N;
        memcpy(p.weight, c.weight, sizeof c.weight);
        if (children)
            pf_resize(&p, children, d == 0 ? 0 : d == 1 ? 0xffffffffu : toy_bits(22, d));
        else
            pf_resample_multinomial(&p, 5, 3, d);
        for (int32_t i = 0; i < p.n; i++) {
            count[p.parent[i]]++;
            c.disorder += i > 0 && p.parent[i] < p.parent[i - 1];
        }
        for (int i = 0; i < N; i++) {
            c.worst = fmax(c.worst, fabs(count[i] - p.n * c.weight[i]));
            c.mean[i] += count[i] / (double)draws;
            c.square[i] += count[i] * count[i] / (double)draws;
        }
    }
    return c;
}

/* Systematic: |count - n w| < 1 always, parents in order, mean count n w; also for another number of
 * children. */
static void test_systematic(void)
{
    enum { DRAWS = 100000 };
    static const int32_t sizes[] = {N, 37, 250};
    for (int kind = 0; kind < KINDS; kind++)
        for (int k = 0; k < 3; k++) {
            uint32_t const draws = k ? DRAWS / 10 : DRAWS;
            counts const c = count_children(kind, draws, sizes[k]);
            CHECK(c.disorder == 0);
            CHECK(c.worst < 1.0 + 1e-6); /* weights have 31 bits */
            for (int i = 0; i < N; i++) {
                double const want = sizes[k] * c.weight[i], part = want - floor(want);
                double const error = sqrt(part * (1.0 - part) / draws);
                CHECK_NEAR(c.mean[i], want, 4.0 * error + 2.0 / draws); /* two offsets are not random */
            }
        }
}

/* Independent draws: binomial counts. */
static void test_multinomial(void)
{
    enum { DRAWS = 100000 };
    for (int kind = 0; kind < KINDS; kind++) {
        counts const c = count_children(kind, DRAWS, 0);
        double spread = 0.0, want = 0.0;
        for (int i = 0; i < N; i++) {
            double const var = N * c.weight[i] * (1.0 - c.weight[i]);
            CHECK_NEAR(c.mean[i], N * c.weight[i], 4.0 * sqrt(var / DRAWS) + 1e-6);
            spread += c.square[i] - c.mean[i] * c.mean[i];
            want += var;
        }
        CHECK_NEAR(spread / want, 1.0, 0.02);
    }
}

/* ---- the mean of a function after resampling ---- */
static const double FULL = 6.28318530717958648;

enum { SYSTEMATIC, STRATIFIED, MULTINOMIAL, WAYS };

/* One offset for each tooth of the comb instead of one for all: not in the library, a yardstick. */
static void stratify(pf *p, uint32_t draw)
{
    double sum = p->weight[0];
    int32_t from = 0;
    for (int32_t i = 0; i < p->n; i++) {
        double const at = (i + (double)toy_uniform(24, (uint32_t)i, draw)) / p->n;
        while (from < p->n - 1 && sum <= at)
            sum += p->weight[++from];
        p->parent[i] = from;
    }
}

/* Variance of the mean of f over the children, times n, by each way. */
static void mean_variance(pf *p, const double *f, double var[WAYS])
{
    enum { DRAWS = 3000 };
    static double kept[TOY_MOST];
    double truth = 0.0;
    memcpy(kept, p->weight, (size_t)p->n * sizeof *kept);
    for (int32_t i = 0; i < p->n; i++)
        truth += kept[i] * f[i];
    for (int way = 0; way < WAYS; way++) {
        var[way] = 0.0;
        for (uint32_t d = 0; d < DRAWS; d++) {
            double off = -truth;
            memcpy(p->weight, kept, (size_t)p->n * sizeof *kept);
            if (way == SYSTEMATIC)
                pf_resample_systematic(p, toy_bits(25, d));
            else if (way == STRATIFIED)
                stratify(p, d);
            else
                pf_resample_multinomial(p, 6, 3, d);
            for (int32_t i = 0; i < p->n; i++)
                off += f[p->parent[i]] / p->n;
            var[way] += off * off * p->n / DRAWS;
        }
    }
}

/* Smooth weights: systematic below stratified, that far below independent draws.  The function is alike at
 * both ends: where it is not, one offset for all costs (f(end) - f(start))^2 / (12 n^2), more than
 * stratified draws. */
static void test_variance(void)
{
    enum { MEANS = 200 };
    double f[MEANS], var[WAYS], truth = 0.0, square = 0.0;
    pf p = weighted(MEANS, SMOOTH);
    for (int i = 0; i < MEANS; i++) {
        f[i] = sin(FULL * i / MEANS);
        truth += p.weight[i] * f[i];
        square += p.weight[i] * f[i] * f[i];
    }
    mean_variance(&p, f, var);
    FIGURE("S3: variance systematic %.1e, stratified %.1e, multinomial %.3f\n", var[0], var[1], var[2]);
    CHECK(var[SYSTEMATIC] < 0.3 * var[STRATIFIED]);
    CHECK(var[STRATIFIED] < 0.1 * var[MULTINOMIAL]);
    CHECK_NEAR(var[MULTINOMIAL] / (square - truth * truth), 1.0, 4.5 * sqrt(2.0 / 3000));
}

/* Why order matters (Douc, Cappe and Moulines 2005): weights 1.5 and 0.5 in turn make all teeth fall on
 * the same side together, so that the mean of "is of the heavy kind" is 1 or 1/2 whatever n; the same
 * weights sorted do not. */
static void test_order(void)
{
    enum { PAIRS = 256 };
    double f[2 * PAIRS], var[2][WAYS];
    for (int sorted = 0; sorted < 2; sorted++) {
        float ll[2 * PAIRS];
        pf p = toy_filter(2 * PAIRS);
        for (int i = 0; i < 2 * PAIRS; i++) {
            f[i] = sorted ? i < PAIRS : i % 2 == 0;
            ll[i] = f[i] > 0.5 ? logf(3.0f) : 0.0f;
        }
        pf_update(&p, ll);
        mean_variance(&p, f, var[sorted]);
        FIGURE("S3: %s: %.1e, %.1e, %.3f\n", sorted ? "sorted" : "in turn", var[sorted][SYSTEMATIC],
               var[sorted][STRATIFIED], var[sorted][MULTINOMIAL]);
        CHECK_NEAR(var[sorted][MULTINOMIAL] / (0.75 * 0.25), 1.0, 4.5 * sqrt(2.0 / 3000));
    }
    CHECK_NEAR(var[0][SYSTEMATIC] / (2.0 * PAIRS / 16.0), 1.0, 0.01); /* 1/4 either way, always */
    CHECK(var[0][STRATIFIED] < var[0][MULTINOMIAL]);
    CHECK(var[1][SYSTEMATIC] < 1.0 / PAIRS);
}

/* ---- the rest ---- */

/* Draws depend on every argument, and on nothing else. */
static void test_seed(void)
{
    enum { SOME = 300 };
    int32_t first[SOME];
    double weight[SOME];
    pf p = weighted(SOME, ROUGH);
    memcpy(weight, p.weight, sizeof weight);
    for (int k = 0; k < 5; k++) {
        memcpy(p.weight, weight, sizeof weight);
        pf_resample_multinomial(&p, k == 1 ? 2 : 1, k == 2 ? 8 : 7, k == 3 ? 10 : 9);
        if (k == 0)
            memcpy(first, p.parent, sizeof first);
        CHECK((memcmp(first, p.parent, sizeof first) == 0) == (k == 0 || k == 4));
    }
}

/* Largest tracker: 2^20 equal weights would overflow narrower cumulative weights. */
static void test_largest(void)
{
    enum { LARGEST = 1 << 20 };
    static _Alignas(GAIT_ALIGN) unsigned char memory[LARGEST * 28 + 4096];
    arena a = {.base = memory, .cap = sizeof memory};
    pf p = pf_layout(&a, LARGEST);
    CHECK(!a.overflow);
    pf_uniform(&p);
    int32_t wrong = 0;
    pf_resample_systematic(&p, 0xffffffffu);
    for (int32_t i = 0; i < LARGEST; i++)
        wrong += p.parent[i] != i;
    CHECK(wrong == 0);
}

int main(void)
{
    test_systematic();
    test_multinomial();
    test_variance();
    test_order();
    test_seed();
    test_largest();
    return CHECK_DONE();
}
