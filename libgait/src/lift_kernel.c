/* Positions by modes: sums in an order that the source fixes, so that lanes change nothing. */
#include "dense.h"
#include "wide.h"

void KERNEL(lift_sum)(double *x, int32_t width, const float *mode, size_t stride, const double *theta,
                      int32_t modes)
{
    double *restrict const to = x;
    int32_t i = 0;
    for (; i + 4 <= modes; i += 4) {
        const float *restrict const m0 = mode + (size_t)i * stride, *restrict const m1 = m0 + stride;
        const float *restrict const m2 = m1 + stride, *restrict const m3 = m2 + stride;
        double const a0 = theta[i], a1 = theta[i + 1], a2 = theta[i + 2], a3 = theta[i + 3];
        for (int32_t j = 0; j < width; j++)
            to[j] = (((to[j] + a0 * (double)m0[j]) + a1 * (double)m1[j]) + a2 * (double)m2[j]) +
                    a3 * (double)m3[j];
    }
    for (; i < modes; i++) {
        const float *restrict const m = mode + (size_t)i * stride;
        for (int32_t j = 0; j < width; j++)
            to[j] += theta[i] * (double)m[j];
    }
}

/* The modes of one coordinate between two frames into `to`; the sum of to[i] theta[i] in eight chains. */
static inline double between(double *to, const float *s0, const float *s1, double w0, double w1,
                             int32_t lanes, const double *theta, int32_t modes)
{
    int32_t const whole = modes / DENSE_LANES * DENSE_LANES;
    double s[DENSE_LANES];
    _Pragma("GCC unroll 8") for (int32_t c = 0; c < DENSE_LANES; c += WIDE)
    {
        wide sum = {0.0};
        for (int32_t i = c; i < lanes; i += DENSE_LANES) {
            wide const x = w0 * wide_load_float(s0 + i) + w1 * wide_load_float(s1 + i);
            wide_store(to + i, x);
            if (i < whole)
                sum += x * wide_load(theta + i);
        }
        wide_store(s + c, sum);
    }
    for (int32_t i = whole; i < modes; i++)
        s[i - whole] += to[i] * theta[i];
    return ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
}

void KERNEL(lift_shape)(double *out, const float *s0, const float *s1, double w0, double w1, int32_t lanes,
                        const double *theta, int32_t modes, double moved[3])
{
    for (int32_t a = 0; a < 3 * lanes; a += lanes)
        *moved++ = between(out + a, s0 + a, s1 + a, w0, w1, lanes, theta, modes);
}

void KERNEL(lift_row)(double *w, const double *shape, int32_t lanes, const double g[3])
{
    double *restrict const to = w;
    const double *restrict const x = shape, *restrict const y = x + lanes, *restrict const z = y + lanes;
    double const g0 = g[0], g1 = g[1], g2 = g[2];
    for (int32_t i = 0; i < lanes; i++)
        to[i] = (g0 * x[i] + g1 * y[i]) + g2 * z[i];
}

void KERNEL(lift_columns)(double *z, size_t stride, const double *shape, int32_t lanes, double M[3][3])
{
    double *to = z;
    for (int32_t i = 0; i < lanes; i += DENSE_LANES) {
        double turned[3][DENSE_LANES];
        for (int32_t a = 0; a < 3; a++)
            for (int32_t k = 0; k < DENSE_LANES; k += WIDE) {
                const double *const s = shape + i + k;
                wide_store(turned[a] + k, (M[a][0] * wide_load(s) + M[a][1] * wide_load(s + lanes)) +
                                              M[a][2] * wide_load(s + 2 * lanes));
            }
        for (int32_t k = 0; k < DENSE_LANES; k++, to += stride)
            for (int32_t a = 0; a < 3; a++)
                to[a] = turned[a][k];
    }
}

void KERNEL(lift_squares)(double *x, int32_t width, const float *Z, size_t stride, int32_t rows)
{
    double *restrict const to = x;
    for (int32_t i = 0; i < rows; i++) {
        const float *restrict const z = Z + (size_t)i * stride;
        for (int32_t j = 0; j < width; j++)
            to[j] += (double)z[j] * (double)z[j];
    }
}
