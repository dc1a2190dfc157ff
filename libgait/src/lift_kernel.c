/* Positions by modes: sums in an order that the source fixes, so that lanes change nothing. */
#include "dense.h"

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

/* Sum of row[i] theta[i] in eight chains. */
static inline double along(const double *restrict row, const double *restrict theta, int32_t modes)
{
    double s[DENSE_LANES] = {0.0};
    int32_t const whole = modes / DENSE_LANES * DENSE_LANES;
    for (int32_t i = 0; i < whole; i += DENSE_LANES)
        for (int32_t k = 0; k < DENSE_LANES; k++)
            s[k] += row[i + k] * theta[i + k];
    for (int32_t i = whole; i < modes; i++)
        s[i - whole] += row[i] * theta[i];
    return ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
}

void KERNEL(lift_shape)(double *out, const float *s0, const float *s1, double w0, double w1, int32_t lanes,
                        const double *theta, int32_t modes, double moved[3])
{
    double *restrict const to = out;
    for (int32_t i = 0; i < 3 * lanes; i++)
        to[i] = w0 * (double)s0[i] + w1 * (double)s1[i];
    for (int32_t a = 0; a < 3; a++)
        moved[a] = along(out + a * lanes, theta, modes);
}

void KERNEL(lift_row)(double *w, const double *shape, int32_t lanes, const double g[3])
{
    double *restrict const to = w;
    const double *restrict const x = shape, *restrict const y = x + lanes, *restrict const z = y + lanes;
    double const g0 = g[0], g1 = g[1], g2 = g[2];
    for (int32_t i = 0; i < lanes; i++)
        to[i] = (g0 * x[i] + g1 * y[i]) + g2 * z[i];
}

void KERNEL(lift_columns)(double *z, size_t stride, const double *shape, int32_t lanes, int32_t modes,
                          double M[3][3])
{
    const double *restrict const s = shape;
    double *restrict to = z;
    for (int32_t i = 0; i < modes; i++, to += stride)
        for (int32_t a = 0; a < 3; a++)
            to[a] = (M[a][0] * s[i] + M[a][1] * s[lanes + i]) + M[a][2] * s[2 * lanes + i];
}

void KERNEL(lift_squares)(double *x, int32_t width, const double *Z, size_t stride, int32_t rows)
{
    double *restrict const to = x;
    for (int32_t i = 0; i < rows; i++) {
        const double *restrict const z = Z + (size_t)i * stride;
        for (int32_t j = 0; j < width; j++)
            to[j] += z[j] * z[j];
    }
}
