/* Evidence of weighted particles against sums by libm for any number of particles; likelihoods that are not finite; annealing. */
#include "filter/evidence.h"
#include "toy_filter.h"

enum { MOST = 200 };

/* Weights that do not sum to 1, likelihoods over `wide` nats. */
static pf uneven(int32_t n, float scale, float ll[MOST])
{
    pf p = toy_filter(n);
    for (int32_t i = 0; i < n; i++) {
        p.weight[i] = 0.1 + (double)toy_uniform(3, (uint32_t)i, 0);
        p.log_weight[i] = log(p.weight[i]);
        ll[i] = scale * toy_uniform(3, (uint32_t)i, 1);
    }
    return p;
}

static double ess_of(const pf *p, const float *ll, float power, float top)
{
    double sum = 0.0, square = 0.0;
    for (int32_t i = 0; i < p->n; i++) {
        double const w = p->weight[i] * exp((double)(power * (ll[i] - top)));
        sum += w;
        square += w * w;
    }
    return sum * sum / square;
}

static void test_mean(void)
{
    for (int32_t n = 1; n <= MOST; n++) {
        float ll[MOST];
        double sum = 0.0, total = 0.0;
        pf const p = uneven(n, 30.0f, ll);
        for (int32_t i = 0; i < n; i++) {
            sum += p.weight[i] * exp((double)ll[i]);
            total += p.weight[i];
        }
        CHECK_NEAR(evidence_of(&p, ll), log(sum / total), 1e-12 * (1.0 + fabs(log(sum / total))));
    }
}

/* Impossible particles keep their weight but add no evidence; if all are impossible there is no evidence. */
static void test_broken(void)
{
    static const float broken[] = {NAN, -INFINITY, -2e30f};
    for (size_t k = 0; k < sizeof broken / sizeof *broken; k++) {
        float ll[MOST];
        double sum = 0.0, total = 0.0;
        pf const p = uneven(MOST, 5.0f, ll);
        for (int32_t i = 0; i < MOST; i++) {
            if (i % 3 == 0)
                ll[i] = broken[k];
            sum += i % 3 == 0 ? 0.0 : p.weight[i] * exp((double)ll[i]);
            total += p.weight[i];
        }
        CHECK_NEAR(evidence_of(&p, ll), log(sum / total), 1e-12);
        for (int32_t i = 0; i < MOST; i++)
            ll[i] = broken[k];
        CHECK(evidence_of(&p, ll) <= -1e30);
    }
}

/* The largest power of 1, 1/2 ... 1/32 that leaves a share of the particles. */
static void test_soften(void)
{
    for (float scale = 1.0f; scale < 3e4f; scale *= 1.7f) {
        float ll[MOST], was[MOST], power = 1.0f;
        double const share = scale < 100.0f ? 0.2 : 0.4;
        pf const p = uneven(MOST, scale, ll);
        while (power > 0.05f && ess_of(&p, ll, power, scale) < share * MOST)
            power *= 0.5f;
        for (int32_t i = 0; i < MOST; i++)
            was[i] = ll[i];
        evidence_anneal(&p, ll, share);
        for (int32_t i = 0; i < MOST; i++)
            CHECK(ll[i] == power * was[i]);
    }
}

int main(void)
{
    test_mean();
    test_broken();
    test_soften();
    return CHECK_DONE();
}
