/* toy_linear.h - a linear-Gaussian system, where a Kalman filter is exact, and the particle filter's core
 * on it: x' = A x + N(0, Q), y = H x + N(0, R), x_0 ~ N(0, 0.3).
 *
 *   linear const s = linear_new(5);
 *   linear_world w = linear_start(&s, seed);        a truth, its observations, and the exact posterior
 *   linear_filter f = linear_filter_new(&s, n, seed);
 *   double exact = linear_next(&w);                 the next step; log p(y | past)
 *   pf_summary sum = linear_filter_step(&f, &w);
 *
 * The proposal can be replaced: f.move, f.rule. */
#ifndef TOY_LINEAR_H
#define TOY_LINEAR_H
#include "toy_filter.h"

enum { LINEAR_MAX = 13, LINEAR_NORMALS = 16 };

typedef struct linear {
    int d;
    double A[LINEAR_MAX], Q[LINEAR_MAX], H[LINEAR_MAX][LINEAR_MAX], R; /* A and Q diagonal, R = R I */
} linear;

typedef struct gauss {
    double mean[LINEAR_MAX], cov[LINEAR_MAX][LINEAR_MAX];
} gauss;

static const double LINEAR_START = 0.3; /* variance */

static inline void linear_normals(uint64_t seed, uint32_t stream, uint32_t step, uint32_t index, int count,
                                  float out[LINEAR_NORMALS])
{
    for (uint32_t k = 0; (int)(4 * k) < count; k++)
        rng_normal4(seed, stream, step, index, k, out + 4 * k);
}

static inline linear linear_new(int d, double R)
{
    linear s = {.d = d, .R = R};
    for (uint32_t i = 0; i < (uint32_t)d; i++) {
        s.A[i] = 0.9 + 0.095 * (double)toy_uniform(21, i, 50);
        s.Q[i] = 0.02 + 0.08 * (double)toy_uniform(21, i, 51);
        for (uint32_t j = 0; j < (uint32_t)d; j++) {
            float n[4];
            rng_normal4(23, 0, 0, i, j, n);
            s.H[i][j] = d == 1 ? 1.0 : (double)n[0] / sqrt(d);
        }
    }
    return s;
}

/* ---- exact ---- */

static inline void kalman_predict(const linear *s, gauss *g)
{
    for (int i = 0; i < s->d; i++) {
        g->mean[i] *= s->A[i];
        for (int j = 0; j < s->d; j++)
            g->cov[i][j] = s->A[i] * g->cov[i][j] * s->A[j] + (i == j ? s->Q[i] : 0.0);
    }
}

/* One scalar observation after the other; returns the log evidence. */
static inline double kalman_update(const linear *s, gauss *g, const double *y)
{
    double evidence = 0.0;
    for (int o = 0; o < s->d; o++) {
        double ph[LINEAR_MAX] = {0}, var = s->R, miss = y[o];
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

typedef struct linear_world {
    const linear *s;
    uint64_t seed;
    uint32_t step;
    double truth[LINEAR_MAX], y[LINEAR_MAX];
    gauss exact;
} linear_world;

static inline linear_world linear_start(const linear *s, uint64_t seed)
{
    linear_world w = {.s = s, .seed = seed};
    float z[LINEAR_NORMALS];
    linear_normals(seed, 1, 0, 0, s->d, z);
    for (int k = 0; k < s->d; k++) {
        w.truth[k] = sqrt(LINEAR_START) * (double)z[k];
        w.exact.cov[k][k] = LINEAR_START;
    }
    return w;
}

static inline double linear_next(linear_world *w)
{
    const linear *const s = w->s;
    float z[LINEAR_NORMALS];
    w->step++;
    linear_normals(w->seed, 3, w->step, 0, s->d, z);
    for (int k = 0; k < s->d; k++)
        w->truth[k] = s->A[k] * w->truth[k] + sqrt(s->Q[k]) * (double)z[k];
    linear_normals(w->seed, 4, w->step, 0, s->d, z);
    for (int k = 0; k < s->d; k++) {
        w->y[k] = sqrt(s->R) * (double)z[k];
        for (int j = 0; j < s->d; j++)
            w->y[k] += s->H[k][j] * w->truth[j];
    }
    kalman_predict(s, &w->exact);
    return kalman_update(s, &w->exact, w->y);
}

/* ---- particles ---- */

/* Move a particle from its ancestor's state by standard normals; returns the log of its weight,
 * p(y | to) p(to | from) / q(to | from, y). */
typedef double linear_move(const linear *s, const void *rule, const double *y, const float *from,
                           const float *z, float *to);

/* Bootstrap: the proposal is the model's own motion. */
static inline double linear_bootstrap(const linear *s, const void *rule, const double *y, const float *from,
                                      const float *z, float *to)
{
    double cost = s->d * log(2.0 * 3.14159265358979 * s->R);
    (void)rule;
    for (int k = 0; k < s->d; k++)
        to[k] = (float)(s->A[k] * (double)from[k] + sqrt(s->Q[k]) * (double)z[k]);
    for (int k = 0; k < s->d; k++) {
        double miss = y[k];
        for (int j = 0; j < s->d; j++)
            miss -= s->H[k][j] * (double)to[j];
        cost += miss * miss / s->R;
    }
    return -0.5 * cost;
}

typedef float linear_particle[LINEAR_MAX];

typedef struct linear_filter {
    const linear *s;
    linear_move *move;
    const void *rule;
    uint64_t seed;
    double resample_ess, ess; /* share of n below which it resamples; of the last step */
    pf p;
    linear_particle *x, *next;
} linear_filter;

static inline linear_filter linear_filter_new(const linear *s, int32_t n, uint64_t seed)
{
    static linear_particle x[2][TOY_MOST];
    linear_filter f = {.s = s, .move = linear_bootstrap, .seed = seed, .resample_ess = 0.5, .ess = n};
    float z[LINEAR_NORMALS];
    f.p = toy_filter(n);
    f.x = x[0];
    f.next = x[1];
    for (int32_t i = 0; i < n; i++) {
        linear_normals(seed, 2, 0, (uint32_t)i, s->d, z);
        for (int k = 0; k < s->d; k++)
            f.x[i][k] = (float)(sqrt(LINEAR_START) * (double)z[k]);
    }
    return f;
}

static inline pf_summary linear_filter_step(linear_filter *f, const linear_world *w)
{
    static float ll[TOY_MOST];
    linear_particle *const old = f->x;
    float z[LINEAR_NORMALS];
    pf_keep(&f->p);
    if (f->ess < f->resample_ess * f->p.n)
        pf_resample_systematic(&f->p, toy_bits(f->seed, w->step));
    for (int32_t i = 0; i < f->p.n; i++) {
        linear_normals(f->seed, 5, w->step, (uint32_t)i, f->s->d, z);
        ll[i] = (float)f->move(f->s, f->rule, w->y, old[f->p.parent[i]], z, f->next[i]);
    }
    f->x = f->next;
    f->next = old;
    pf_summary const sum = pf_update(&f->p, ll);
    f->ess = sum.ess;
    return sum;
}

/* ---- particles against the exact posterior ---- */
typedef struct linear_error {
    double square;     /* of the mean, in posterior standard deviations */
    double log_square; /* its logarithm */
    double variance;   /* particles / exact */
    double ess;        /* share of n; all four: mean over steps and components */
    double evidence;   /* sum over steps of the log, particles - exact */
} linear_error;

static inline void linear_compare(const linear_filter *f, const gauss *exact, double share, linear_error *e)
{
    for (int k = 0; k < f->s->d; k++) {
        double mean = 0.0, var = 0.0;
        for (int32_t i = 0; i < f->p.n; i++)
            mean += f->p.weight[i] * (double)f->x[i][k];
        for (int32_t i = 0; i < f->p.n; i++)
            var += f->p.weight[i] * ((double)f->x[i][k] - mean) * ((double)f->x[i][k] - mean);
        double const off = mean - exact->mean[k], square = off * off / exact->cov[k][k];
        e->square += share * square / f->s->d;
        e->log_square += share * log(square) / f->s->d;
        e->variance += share * var / exact->cov[k][k] / f->s->d;
    }
}

/* A new world of this seed for so many steps. */
static inline linear_error linear_run(linear_filter f, int steps)
{
    linear_world w = linear_start(f.s, f.seed);
    linear_error e = {0};
    for (int t = 0; t < steps; t++) {
        double const exact = linear_next(&w);
        pf_summary const sum = linear_filter_step(&f, &w);
        e.evidence += sum.log_evidence - exact;
        e.ess += sum.ess / f.p.n / steps;
        linear_compare(&f, &w.exact, 1.0 / steps, &e);
    }
    return e;
}
#endif
