/* Weights and resampling: exact cases and statistics of the counts (spec 3.5). */
#include "pf.h"

#include "rng.h"

#include "check.h"

enum { MOST = 4096 };

static pf make(int32_t n)
{
    static _Alignas(GAIT_ALIGN) unsigned char memory[MOST * 40];
    arena a = {.base = memory, .cap = sizeof memory};
    pf p = pf_layout(&a, n);
    CHECK(!a.overflow);
    pf_uniform(&p);
    pf_keep(&p);
    return p;
}

static float uniform(uint32_t index, uint32_t draw)
{
    float u[4];
    rng_uniform4(21, 0, 0, index, draw, u);
    return u[0];
}

static uint32_t word(uint32_t index)
{
    uint32_t r[4];
    rng_bits(22, 0, 0, index, 0, r);
    return r[0];
}

/* Weights of the given kind; normalised. */
enum { SMOOTH, EXTREME, ROUGH, KINDS };
static void set_weights(pf *p, int kind)
{
    float ll[MOST];
    for (int32_t i = 0; i < p->n; i++) {
        float const x = (float)i / (float)p->n, u = uniform((uint32_t)i, 1);
        ll[i] = kind == SMOOTH  ? -8.0f * (x - 0.4f) * (x - 0.4f)
                : kind == ROUGH ? logf(u + 0.01f)
                                : -14.0f * u;
    }
    pf_uniform(p);
    pf_summary const s = pf_reweigh(p, ll);
    CHECK(!s.degenerate);
}

/* ---- weights ---- */
static void test_reweigh(void)
{
    enum { N = 40 };
    static const float base[] = {0.0f, -3e4f, 3e4f};
    for (size_t k = 0; k < 3; k++) {
        pf p = make(N);
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
            pf_summary const s = pf_reweigh(&p, ll);
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
    pf p = make(N);
    float ll[N];
    for (int i = 0; i < N; i++)
        ll[i] = -12.5f;
    pf_summary const s = pf_reweigh(&p, ll);
    CHECK_NEAR(s.log_evidence, -12.5, 1e-12);
    CHECK_NEAR(s.ess, N, 1e-9);
    CHECK(s.best == 0);
    pf_resample_systematic(&p, 0x80000000u);
    for (int i = 0; i < N; i++)
        CHECK(p.parent[i] == i);
}

/* A likelihood that is not a number is no likelihood. */
static void test_broken(void)
{
    enum { N = 8 };
    static const float bad[] = {NAN, -INFINITY, INFINITY};
    for (size_t k = 0; k < 3; k++) {
        pf p = make(N);
        float ll[N] = {0};
        ll[2] = bad[k];
        ll[5] = bad[(k + 1) % 3];
        pf_summary s = pf_reweigh(&p, ll);
        CHECK(!s.degenerate && p.weight[2] == 0.0 && p.weight[5] == 0.0);
        CHECK_NEAR(p.weight[0], 1.0 / 6.0, 1e-12);
        CHECK_NEAR(s.log_evidence, log(6.0 / 8.0), 1e-12);
        CHECK_NEAR(s.ess, 6.0, 1e-9);
        for (int i = 0; i < N; i++)
            ll[i] = 5.0f;
        s = pf_reweigh(&p, ll); /* once impossible, it stays so until it is resampled */
        CHECK(p.weight[2] == 0.0 && fabs(s.log_evidence - 5.0) < 1e-12);
        pf_resample_systematic(&p, 123456789u);
        for (int i = 0; i < N; i++)
            CHECK(p.parent[i] != 2 && p.parent[i] != 5 && p.weight[i] == 0.125);
        /* All of them: the weights are left alone, and that is told. */
        set_weights(&p, ROUGH);
        double kept[N], kept_log[N];
        memcpy(kept, p.weight, sizeof kept);
        memcpy(kept_log, p.log_weight, sizeof kept_log);
        for (int i = 0; i < N; i++)
            ll[i] = bad[k];
        s = pf_reweigh(&p, ll);
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
            pf p = make(N);
            float ll[N];
            for (int i = 0; i < N; i++)
                ll[i] = i == at ? 0.0f : -2000.0f; /* below what exp() can tell from 0 */
            pf_summary const s = pf_reweigh(&p, ll);
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
        pf p = make(N);
        float ll[N] = {0};
        ll[0] = ll[1] = ll[N - 1] = -INFINITY;
        pf_reweigh(&p, ll);
        pf_resample_systematic(&p, k ? 0xffffffffu : 0u);
        CHECK(p.parent[0] == 2 && p.parent[N - 1] == N - 2);
    }
}

/* ---- counts ---- */

/* Systematic: |count - N w| < 1 always, parents in order, mean count N w. */
static void test_systematic(void)
{
    enum { N = 100, DRAWS = 20000 };
    for (int kind = 0; kind < KINDS; kind++) {
        pf p = make(N);
        double weight[N], mean[N] = {0};
        set_weights(&p, kind);
        memcpy(weight, p.weight, sizeof weight);
        double worst = 0.0;
        int32_t disorder = 0;
        for (uint32_t d = 0; d < DRAWS; d++) {
            int32_t count[N] = {0};
            memcpy(p.weight, weight, sizeof weight);
            pf_resample_systematic(&p, d == 0 ? 0 : d == 1 ? 0xffffffffu : word(d));
            for (int i = 0; i < N; i++) {
                count[p.parent[i]]++;
                disorder += i > 0 && p.parent[i] < p.parent[i - 1];
            }
            for (int i = 0; i < N; i++) {
                worst = fmax(worst, fabs(count[i] - N * weight[i]));
                mean[i] += count[i] / (double)DRAWS;
            }
        }
        CHECK(disorder == 0);
        CHECK(worst < 1.0 + 1e-6); /* weights have 31 bits */
        for (int i = 0; i < N; i++) {
            double const part = N * weight[i] - floor(N * weight[i]);
            CHECK_NEAR(mean[i], N * weight[i], 4.5 * sqrt(part * (1.0 - part) / DRAWS) + 1e-6);
        }
    }
}

static void test_multinomial(void)
{
    enum { N = 100, DRAWS = 20000 };
    for (int kind = 0; kind < KINDS; kind++) {
        pf p = make(N);
        double weight[N], mean[N] = {0}, square[N] = {0};
        set_weights(&p, kind);
        memcpy(weight, p.weight, sizeof weight);
        for (uint32_t d = 0; d < DRAWS; d++) {
            int32_t count[N] = {0};
            memcpy(p.weight, weight, sizeof weight);
            pf_resample_multinomial(&p, 5, 3, d);
            for (int i = 0; i < N; i++)
                count[p.parent[i]]++;
            for (int i = 0; i < N; i++) {
                mean[i] += count[i] / (double)DRAWS;
                square[i] += count[i] * count[i] / (double)DRAWS;
            }
        }
        double spread = 0.0, want = 0.0;
        for (int i = 0; i < N; i++) {
            double const var = N * weight[i] * (1.0 - weight[i]);
            CHECK_NEAR(mean[i], N * weight[i], 4.5 * sqrt(var / DRAWS) + 1e-6);
            spread += square[i] - mean[i] * mean[i];
            want += var;
        }
        CHECK_NEAR(spread / want, 1.0, 0.02); /* independent draws: binomial counts */
    }
}

/* Variance of a mean after resampling: systematic far below multinomial where weights are smooth. */
static void test_variance(void)
{
    enum { N = 200, DRAWS = 3000 };
    pf p = make(N);
    double weight[N], truth = 0.0, var[2] = {0};
    set_weights(&p, SMOOTH);
    memcpy(weight, p.weight, sizeof weight);
    for (int i = 0; i < N; i++)
        truth += weight[i] * sin(5.0 * i / N);
    for (uint32_t d = 0; d < DRAWS; d++)
        for (int multinomial = 0; multinomial < 2; multinomial++) {
            double mean = 0.0;
            memcpy(p.weight, weight, sizeof weight);
            if (multinomial)
                pf_resample_multinomial(&p, 6, 3, d);
            else
                pf_resample_systematic(&p, word(d + 77777));
            for (int i = 0; i < N; i++)
                mean += sin(5.0 * p.parent[i] / N) / N;
            var[multinomial] += (mean - truth) * (mean - truth) / DRAWS;
        }
    CHECK(var[0] < 0.05 * var[1]);
    CHECK(var[1] > 0.0005 && var[1] < 0.005); /* about 0.4 / N */
}

/* Draws depend on every argument, and on nothing else. */
static void test_seed(void)
{
    enum { N = 300 };
    pf p = make(N);
    int32_t first[N];
    double weight[N];
    set_weights(&p, ROUGH);
    memcpy(weight, p.weight, sizeof weight);
    for (int k = 0; k < 5; k++) {
        memcpy(p.weight, weight, sizeof weight);
        pf_resample_multinomial(&p, k == 1 ? 2 : 1, k == 2 ? 8 : 7, k == 3 ? 10 : 9);
        if (k == 0)
            memcpy(first, p.parent, sizeof first);
        CHECK((memcmp(first, p.parent, sizeof first) == 0) == (k == 0 || k == 4));
    }
}

/* Largest tracker: 2^20 equal weights would overflow narrower tickets. */
static void test_largest(void)
{
    enum { N = 1 << 20 };
    static _Alignas(GAIT_ALIGN) unsigned char memory[N * 28 + 4096];
    arena a = {.base = memory, .cap = sizeof memory};
    pf p = pf_layout(&a, N);
    CHECK(!a.overflow);
    pf_uniform(&p);
    int32_t wrong = 0;
    pf_resample_systematic(&p, 0xffffffffu);
    for (int32_t i = 0; i < N; i++)
        wrong += p.parent[i] != i;
    CHECK(wrong == 0);
}

int main(void)
{
    test_reweigh();
    test_equal();
    test_broken();
    test_single();
    test_zero_ends();
    test_systematic();
    test_multinomial();
    test_variance();
    test_seed();
    test_largest();
    return CHECK_DONE();
}
