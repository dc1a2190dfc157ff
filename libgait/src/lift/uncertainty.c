#include "lift/uncertainty.h"

#include "lift/segment_posterior.h"

#include <string.h>

#define ROUNDS         100   /* of the scale; 20 are enough for 1e-8 */
#define NO_INFORMATION 1e-13 /* eigenvalues below this share of the largest are rounding */

/* Sum over all markers and frames of products of displacements: G (n x n, upper), square metres. */
static void gram(const lift_table *t, const segment_posterior *b, double *G)
{
    memset(G, 0, (size_t)t->ld * (size_t)t->ld * sizeof *G);
    for (int32_t f = 0; f < t->prior.frames; f++) {
        lift_modes(t, b, f);
        t->run->cholesky_rank(G, t->ld, t->Z, 3 * t->prior.markers);
    }
}

static void mirror(double *S, int32_t n, int32_t ld)
{
    for (int32_t i = 0; i < n; i++)
        for (int32_t j = 0; j < i; j++)
            S[i * ld + j] = S[j * ld + i];
}

static void transpose(double *S, int32_t n, int32_t ld)
{
    for (int32_t i = 0; i < n; i++)
        for (int32_t j = 0; j < i; j++) {
            double const x = S[i * ld + j];
            S[i * ld + j] = S[j * ld + i];
            S[j * ld + i] = x;
        }
}

void lift_least_squares(const lift_table *t, const lift_window *w, const segment_posterior *b,
                        segment_posterior *spare)
{
    lift_table plain = *t;
    segment_posterior fit = *b;
    int32_t const n = t->turn < 0 ? t->n : t->n - 1, ld = t->ld;
    size_t const J = (size_t)t->prior.markers;
    double *const length = spare->theta, *const S = spare->A, *const V = spare->U;
    plain.gamma = 0.0;
    gram(t, b, S);
    for (int32_t i = 0; i < n; i++)
        length[i] = sqrt(S[i * (ld + 1)]);
    fit.A = S;
    fit.centre = fit.heading; /* the heading is not fitted */
    memset(S, 0, (size_t)ld * (size_t)ld * sizeof *S);
    for (int32_t f = 0; f < w->frames; f++) {
        lift_observations const observed = {.uv = w->uv + (size_t)f * J * 2, .sd = w->sd + (size_t)f * J};
        lift_add(&plain, &fit, w->at[f], &observed, NULL, 0.0);
    }
    double *const y = t->W; /* no longer needed; n numbers */
    for (int32_t i = 0; i < n; i++) {
        double const unit = length[i] > 0.0 ? 1.0 / length[i] : 0.0;
        y[i] = S[i * ld + t->n] * unit;
        for (int32_t j = i; j < n; j++)
            S[i * ld + j] *= unit * (length[j] > 0.0 ? 1.0 / length[j] : 0.0);
    }
    mirror(S, n, ld);
    symmetric_eigen(S, V, n, ld);
    double *const x = t->W + ld;
    memset(x, 0, (size_t)ld * sizeof *x);
    for (int32_t i = 0; i < n && S[i * (ld + 1)] > NO_INFORMATION * S[0]; i++) {
        double along = 0.0;
        for (int32_t j = 0; j < n; j++)
            along += V[i * ld + j] * y[j];
        for (int32_t j = 0; j < n; j++)
            x[j] += V[i * ld + j] * (along / S[i * (ld + 1)]);
    }
    for (int32_t i = 0; i < n; i++)
        length[i] = length[i] > 0.0 ? x[i] / length[i] : 0.0;
    if (t->turn >= 0)
        spare->theta[t->turn] = t->cfg.heading_sd < 0.0 ? 0.0 : b->theta[t->turn];
    memset(t->W, 0, 2 * J * (size_t)ld * sizeof *t->W);
}

/* Make the entry of largest magnitude positive. */
static void set_sign(double *x, size_t n)
{
    double largest = 0.0;
    for (size_t i = 0; i < n; i++)
        largest = fabs(x[i]) > fabs(largest) ? x[i] : largest;
    for (size_t i = 0; largest < 0.0 && i < n; i++)
        x[i] = -x[i];
}

/* Displacements (count x F x J x 3) by rows of unknowns. */
static void displacements(const lift_table *t, const segment_posterior *b, const double *unknowns,
                          int32_t count, double *out)
{
    size_t const J3 = 3 * (size_t)t->prior.markers, whole = J3 * (size_t)t->prior.frames;
    memset(out, 0, (size_t)count * whole * sizeof *out);
    for (int32_t f = 0; f < t->prior.frames; f++) {
        lift_modes(t, b, f);
        for (int32_t m = 0; m < count; m++) {
            double *const x = out + (size_t)m * whole + (size_t)f * J3;
            for (size_t c = 0; c < J3; c++)
                for (int32_t i = 0; i < t->n; i++)
                    x[c] += unknowns[m * t->ld + i] * t->Z[c * (size_t)t->ld + (size_t)i];
        }
    }
    for (int32_t m = 0; m < count; m++)
        set_sign(out + (size_t)m * whole, whole);
}

void lift_uncertain(const lift_table *t, const segment_posterior *b, segment_posterior *spare, int32_t count,
                    double *mode, double *sd)
{
    int32_t const n = t->n, ld = t->ld;
    double *const S = spare->A, *const V = spare->U;
    gram(t, b, S);
    mirror(S, n, ld);
    t->run->cholesky_forward(b->U, n, ld, S, ld, ld); /* U^-T G, then U^-T (U^-T G)' = U^-T G U^-1 */
    transpose(S, n, ld);
    t->run->cholesky_forward(b->U, n, ld, S, ld, ld);
    for (int32_t i = 0; i < n; i++)
        for (int32_t j = 0; j < i; j++)
            S[i * ld + j] = S[j * ld + i] = 0.5 * (S[i * ld + j] + S[j * ld + i]);
    symmetric_eigen(S, V, n, ld);
    for (int32_t i = 0; i < count; i++) {
        double const variance = S[i * (ld + 1)];
        sd[i] = variance > 0.0 ? sqrt(variance) : 0.0;
        cholesky_backward(b->U, n, ld, V + (size_t)i * (size_t)ld);
    }
    displacements(t, b, V, count, mode);
}

/* U^-T (ld x ld), of which Q is the product with its transpose. */
static double *inverse_root(const lift_table *t, const segment_posterior *b, segment_posterior *spare)
{
    double *const Y = spare->A;
    memset(Y, 0, (size_t)t->ld * (size_t)t->ld * sizeof *Y);
    for (int32_t i = 0; i < t->n; i++)
        Y[i * (t->ld + 1)] = 1.0;
    t->run->cholesky_forward(b->U, t->n, t->ld, Y, t->ld, t->ld);
    return Y;
}

/* Q of the first k unknowns, rows of `stride`; spare->A is lost. */
static void covariance(const lift_table *t, const segment_posterior *b, segment_posterior *spare, int32_t k,
                       double *Q, int32_t stride)
{
    const double *const Y = inverse_root(t, b, spare);
    for (int32_t i = 0; i < k; i++)
        for (int32_t j = i; j < k; j++) {
            double sum = 0.0;
            for (int32_t l = j; l < t->n; l++)
                sum += Y[l * t->ld + i] * Y[l * t->ld + j];
            Q[i * stride + j] = Q[j * stride + i] = sum;
        }
}

void lift_covariance(const lift_table *t, const segment_posterior *b, segment_posterior *spare, double *Q)
{
    covariance(t, b, spare, t->n, Q, t->n);
}

/* MacKay's fixed point of the evidence, along the axes in which the observations separate the modes. */
double lift_scale(const lift_table *t, const segment_posterior *b, segment_posterior *spare)
{
    int32_t const k = t->prior.modes, ld = t->ld;
    double *const Q = spare->U, *const V = spare->A, *const x = spare->theta;
    double scale = 1.0;
    covariance(t, b, spare, k, Q, ld);
    symmetric_eigen(Q, V, k, ld);
    for (int32_t i = 0; i < k; i++) {
        x[i] = 0.0;
        for (int32_t j = 0; j < k; j++)
            x[i] += V[i * ld + j] * b->theta[j];
    }
    for (int32_t round = 0; round < ROUNDS; round++) {
        double size = LIFT_FREEDOM, resolved = LIFT_FREEDOM;
        for (int32_t i = 0; i < k; i++) {
            double const q = Q[i * (ld + 1)], gain = scale / (q + scale * (1.0 - q));
            size += gain * gain * x[i] * x[i];
            resolved += gain * (1.0 - q);
        }
        scale = size / resolved;
    }
    return scale;
}
