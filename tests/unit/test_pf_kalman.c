/* The particle filter's core with a linear-Gaussian model, where a Kalman filter is exact (spec 3.4):
 * x' = A x + N(0, Q), y = H x + N(0, R). */
#include "pf.h"

#include "rng.h"

#include "check.h"

enum { MOST = 4096 };

static float uniform(uint32_t index, uint32_t draw)
{
    float u[4];
    rng_uniform4(21, 0, 0, index, draw, u);
    return u[0];
}

enum { DIM = 5, STEPS = 50 };

typedef struct linear {
    int d;
    double A[DIM], Q[DIM], H[DIM][DIM], R;
} linear;

typedef struct gauss {
    double mean[DIM], cov[DIM][DIM];
} gauss;

static void kalman_predict(const linear *s, gauss *g)
{
    for (int i = 0; i < s->d; i++) {
        g->mean[i] *= s->A[i];
        for (int j = 0; j < s->d; j++)
            g->cov[i][j] = s->A[i] * g->cov[i][j] * s->A[j] + (i == j ? s->Q[i] : 0.0);
    }
}

/* One scalar observation after the other; returns the log evidence. */
static double kalman_update(const linear *s, gauss *g, const double *y)
{
    double evidence = 0.0;
    for (int o = 0; o < s->d; o++) {
        double ph[DIM] = {0}, var = s->R, miss = y[o];
        for (int i = 0; i < s->d; i++) {
            for (int j = 0; j < s->d; j++)
                ph[i] += g->cov[i][j] * s->H[o][j];
            var += s->H[o][i] * ph[i];
            miss -= s->H[o][i] * g->mean[i];
        }
        evidence -= 0.5 * (log(2.0 * 3.14159265358979 * var) + miss * miss / var);
        for (int i = 0; i < s->d; i++) {
            g->mean[i] += ph[i] * miss / var;
            for (int j = 0; j < s->d; j++)
                g->cov[i][j] -= ph[i] * ph[j] / var;
        }
    }
    return evidence;
}

static linear make_linear(int d, double R)
{
    linear s = {.d = d, .R = R};
    for (uint32_t i = 0; i < (uint32_t)d; i++) {
        s.A[i] = 0.9 + 0.095 * (double)uniform(i, 50);
        s.Q[i] = 0.02 + 0.08 * (double)uniform(i, 51);
        for (uint32_t j = 0; j < (uint32_t)d; j++) {
            float n[4];
            rng_normal4(23, 0, 0, i, j, n);
            s.H[i][j] = d == 1 ? 1.0 : (double)n[0] / sqrt(d);
        }
    }
    return s;
}

/* Normals of dimension up to 8 for one purpose. */
static void draw(uint64_t seed, uint32_t stream, uint32_t step, uint32_t index, float out[8])
{
    rng_normal4(seed, stream, step, index, 0, out);
    rng_normal4(seed, stream, step, index, 1, out + 4);
}

/* Common offset of one systematic resampling. */
static uint32_t offset(uint64_t seed, uint32_t step)
{
    uint32_t r[4];
    rng_bits(seed, 6, step, 0, 0, r);
    return r[0];
}

typedef struct outcome {
    double square, evidence, variance; /* of the mean's error in posterior deviations; PF - KF; PF / KF */
} outcome;

static outcome run(const linear *s, int32_t n, uint64_t seed, double resample_ess)
{
    static float x[2][MOST][DIM];
    float ll[MOST], z[8];
    static _Alignas(GAIT_ALIGN) unsigned char memory[MOST * 40];
    arena room = {.base = memory, .cap = sizeof memory};
    pf p = pf_layout(&room, n);
    gauss g = {.mean = {0}};
    double truth[DIM], y[DIM], ess = n;
    outcome o = {0};
    int now = 0;
    pf_uniform(&p);
    draw(seed, 1, 0, 0, z);
    for (int k = 0; k < s->d; k++) {
        truth[k] = sqrt(0.3) * (double)z[k];
        g.cov[k][k] = 0.3;
    }
    for (int32_t i = 0; i < n; i++) {
        draw(seed, 2, 0, (uint32_t)i, z);
        for (int k = 0; k < s->d; k++)
            x[0][i][k] = (float)(sqrt(0.3) * (double)z[k]);
    }
    for (uint32_t t = 1; t <= STEPS; t++) {
        double mean[DIM] = {0}, var[DIM] = {0};
        draw(seed, 3, t, 0, z);
        for (int k = 0; k < s->d; k++)
            truth[k] = s->A[k] * truth[k] + sqrt(s->Q[k]) * (double)z[k];
        draw(seed, 4, t, 0, z);
        for (int k = 0; k < s->d; k++) {
            y[k] = sqrt(s->R) * (double)z[k];
            for (int j = 0; j < s->d; j++)
                y[k] += s->H[k][j] * truth[j];
        }
        pf_keep(&p);
        if (ess < resample_ess * n)
            pf_resample_systematic(&p, offset(seed, t));
        for (int32_t i = 0; i < n; i++) {
            const float *const from = x[now][p.parent[i]];
            double cost = s->d * log(2.0 * 3.14159265358979 * s->R);
            draw(seed, 5, t, (uint32_t)i, z);
            for (int k = 0; k < s->d; k++)
                x[1 - now][i][k] = (float)(s->A[k] * (double)from[k] + sqrt(s->Q[k]) * (double)z[k]);
            for (int k = 0; k < s->d; k++) {
                double miss = y[k];
                for (int j = 0; j < s->d; j++)
                    miss -= s->H[k][j] * (double)x[1 - now][i][j];
                cost += miss * miss / s->R;
            }
            ll[i] = (float)(-0.5 * cost);
        }
        now = 1 - now;
        pf_summary const sum = pf_reweigh(&p, ll);
        ess = sum.ess;
        kalman_predict(s, &g);
        o.evidence += sum.log_evidence - kalman_update(s, &g, y);
        for (int32_t i = 0; i < n; i++)
            for (int k = 0; k < s->d; k++)
                mean[k] += p.weight[i] * (double)x[now][i][k];
        for (int k = 0; k < s->d; k++) {
            for (int32_t i = 0; i < n; i++)
                var[k] += p.weight[i] * ((double)x[now][i][k] - mean[k]) * ((double)x[now][i][k] - mean[k]);
            double const e = mean[k] - g.mean[k];
            o.square += e * e / g.cov[k][k] / (STEPS * s->d);
            o.variance += var[k] / g.cov[k][k] / (STEPS * s->d);
        }
    }
    return o;
}

/* Errors of the mean shrink nearly as 1 / sqrt(N) and are those of a correct filter (numpy twin: 4.5 .. 7 / sqrt(N)
 * at d = 5, 1.5 at d = 1); variance and evidence are right. */
static void test_kalman(void)
{
    enum { SEEDS = 12, FEW = 250, MANY = 2250 };
    static const double thresholds[] = {0.5, 1.1}; /* resampling now and then, and in every step */
    linear const one = make_linear(1, 0.04), five = make_linear(DIM, 0.25);
    for (size_t k = 0; k < 2; k++) {
        double few = 0.0, many = 0.0, single = 0.0, evidence = 0.0, variance = 0.0, widest = 0.0;
        for (uint64_t seed = 1; seed <= SEEDS; seed++) {
            outcome const a = run(&five, FEW, seed, thresholds[k]), b = run(&five, MANY, seed, thresholds[k]);
            outcome const c = run(&one, MANY, seed, thresholds[k]);
            few += a.square / SEEDS;
            many += b.square / SEEDS;
            single += c.square / SEEDS;
            evidence += c.evidence / SEEDS;
            variance += c.variance / SEEDS;
            widest = fmax(widest, fabs(c.evidence));
        }
        CHECK_NEAR(sqrt(few / many), 2.7, 0.7);
        CHECK_NEAR(sqrt(many * MANY), 6.0, 2.0);
        CHECK_NEAR(sqrt(single * MANY), 1.7, 0.6);
        CHECK_NEAR(variance, 1.0, 0.02);
        CHECK_NEAR(evidence, 0.0, 0.3); /* a mean of logs lies below the log of the mean */
        CHECK(widest < 1.2);
    }
}

int main(void)
{
    test_kalman();
    return CHECK_DONE();
}
