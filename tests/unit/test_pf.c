/* Weights: exact cases, broken likelihoods, and resampling. */
#include "toy_filter.h"

static float uniform(uint32_t index, uint32_t draw)
{
    return toy_uniform(21, index, draw);
}

static void test_reweigh(void)
{
    enum { N = 40 };
    static const float base[] = {0.0f, -3e4f, 3e4f};
    for (size_t k = 0; k < 3; k++) {
        pf p = toy_filter(N);
        float ll[N];
        double w[N], log_total = 0.0;
        for (int i = 0; i < N; i++)
            w[i] = 1.0 / N;
        for (uint32_t round = 0; round < 3; round++) { /* without resampling the weights multiply */
            double total = 0.0, sum = 0.0, square = 0.0;
            int32_t best = 0;
            for (uint32_t i = 0; i < N; i++) {
                ll[i] = base[k] + 6.0f * uniform(i, 10 + round);
                w[i] *= exp((double)(ll[i] - base[k]));
                total += w[i];
            }
            for (int i = 0; i < N; i++) {
                w[i] /= total;
                best = w[i] > w[best] ? i : best;
            }
            log_total = log(total) + (double)base[k];
            pf_summary const s = pf_update(&p, ll);
            CHECK_NEAR(s.log_evidence, log_total, 1e-6 * fabs(log_total) + 1e-12);
            CHECK(s.best == best && !s.degenerate);
            for (int i = 0; i < N; i++) {
                CHECK_NEAR(p.weight[i], w[i], 1e-12);
                CHECK_NEAR(p.log_weight[i], log(w[i]), 1e-10);
                sum += p.weight[i];
                square += w[i] * w[i];
            }
            CHECK_NEAR(sum, 1.0, 1e-12);
            CHECK_NEAR(s.ess, 1.0 / square, 1e-9 / square);
            CHECK(pf_ess(&p) == s.ess);
        }
    }
}

/* Equal likelihoods change nothing; of equal weights the first is the best. */
static void test_equal(void)
{
    enum { N = 100 };
    pf p = toy_filter(N);
    float ll[N];
    for (int i = 0; i < N; i++)
        ll[i] = -12.5f;
    pf_summary const s = pf_update(&p, ll);
    CHECK_NEAR(s.log_evidence, -12.5, 1e-12);
    CHECK_NEAR(s.ess, N, 1e-9);
    CHECK(s.best == 0);
    pf_resample_systematic(&p, 0x80000000u);
    for (int i = 0; i < N; i++)
        CHECK(p.parent[i] == i);
}

/* A likelihood that is NaN counts as 0. */
static void test_broken(void)
{
    enum { N = 8 };
    static const float bad[] = {NAN, -INFINITY, INFINITY};
    for (size_t k = 0; k < 3; k++) {
        pf p = toy_filter(N);
        float ll[N] = {0};
        ll[2] = bad[k];
        ll[5] = bad[(k + 1) % 3];
        pf_summary s = pf_update(&p, ll);
        CHECK(!s.degenerate && p.weight[2] == 0.0 && p.weight[5] == 0.0);
        CHECK_NEAR(p.weight[0], 1.0 / 6.0, 1e-12);
        CHECK_NEAR(s.log_evidence, log(6.0 / 8.0), 1e-12);
        CHECK_NEAR(s.ess, 6.0, 1e-9);
        for (int i = 0; i < N; i++)
            ll[i] = 5.0f;
        s = pf_update(&p, ll); /* once impossible, it stays so until it is resampled */
        CHECK(p.weight[2] == 0.0 && fabs(s.log_evidence - 5.0) < 1e-12);
        pf_resample_systematic(&p, 123456789u);
        for (int i = 0; i < N; i++)
            CHECK(p.parent[i] != 2 && p.parent[i] != 5 && p.weight[i] == 0.125);
        /* If all are NaN, the weights stay unchanged, and the summary reports it. */
        pf_uniform(&p);
        for (uint32_t i = 0; i < N; i++)
            ll[i] = 3.0f * uniform(i, 1);
        CHECK(!pf_update(&p, ll).degenerate);
        double kept[N], kept_log[N];
        memcpy(kept, p.weight, sizeof kept);
        memcpy(kept_log, p.log_weight, sizeof kept_log);
        for (int i = 0; i < N; i++)
            ll[i] = bad[k];
        s = pf_update(&p, ll);
        CHECK(s.degenerate && s.log_evidence == 0.0 && s.best >= 0 && s.best < N);
        CHECK(memcmp(kept, p.weight, sizeof kept) == 0 &&
              memcmp(kept_log, p.log_weight, sizeof kept_log) == 0);
        CHECK(s.ess == pf_ess(&p));
    }
}

/* One particle takes all. */
static void test_single(void)
{
    enum { N = 64 };
    for (int multinomial = 0; multinomial < 2; multinomial++)
        for (int32_t at = 0; at < N; at += 21) {
            pf p = toy_filter(N);
            float ll[N];
            for (int i = 0; i < N; i++)
                ll[i] = i == at ? 0.0f : -2000.0f; /* exp() of it is 0 */
            pf_summary const s = pf_update(&p, ll);
            CHECK(s.best == at && p.weight[at] == 1.0 && s.ess == 1.0);
            if (multinomial)
                pf_resample_multinomial(&p, 3, 1, (uint32_t)at);
            else
                pf_resample_systematic(&p, 0xffffffffu);
            for (int i = 0; i < N; i++)
                CHECK(p.parent[i] == at);
            CHECK(p.weight[0] == 1.0 / N && fabs(p.log_weight[5] + log(N)) < 1e-15);
        }
}

/* Impossible particles are never drawn, at either end of the comb. */
static void test_zero_ends(void)
{
    enum { N = 16 };
    for (int k = 0; k < 2; k++) {
        pf p = toy_filter(N);
        float ll[N] = {0};
        ll[0] = ll[1] = ll[N - 1] = -INFINITY;
        pf_update(&p, ll);
        pf_resample_systematic(&p, k ? 0xffffffffu : 0u);
        CHECK(p.parent[0] == 2 && p.parent[N - 1] == N - 2);
    }
}

int main(void)
{
    test_reweigh();
    test_equal();
    test_broken();
    test_single();
    test_zero_ends();
    return CHECK_DONE();
}
