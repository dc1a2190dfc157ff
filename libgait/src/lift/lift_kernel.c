/* Positions from modes.  The source fixes the order of each sum, so the bits do not depend on the number of lanes. */
#include "base/cholesky.h"
#include "base/simd_f64.h"

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

/* Interpolate the modes of one coordinate between two frames into `to`; returns the sum of to[i] theta[i], added up as
 * eight independent sums. */
static inline double between(double *to, const float *s0, const float *s1, double w0, double w1,
                             int32_t lanes, const double *theta, int32_t modes)
{
    int32_t const whole = modes / CHOLESKY_LANES * CHOLESKY_LANES;
    double s[CHOLESKY_LANES];
    _Pragma("GCC unroll 8") for (int32_t c = 0; c < CHOLESKY_LANES; c += SIMD_F64)
    {
        simd_f64 sum = {0.0};
        for (int32_t i = c; i < lanes; i += CHOLESKY_LANES) {
            simd_f64 const x = w0 * simd_f64_load_float(s0 + i) + w1 * simd_f64_load_float(s1 + i);
            simd_f64_store(to + i, x);
            if (i < whole)
                sum += x * simd_f64_load(theta + i);
        }
        simd_f64_store(s + c, sum);
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
    const double *const x = shape, *const y = x + lanes, *const z = y + lanes;
    double const g0 = g[0], g1 = g[1], g2 = g[2];
    for (int32_t i = 0; i < lanes; i += SIMD_F64)
        simd_f64_store(w + i,
                       (g0 * simd_f64_load(x + i) + g1 * simd_f64_load(y + i)) + g2 * simd_f64_load(z + i));
}

/* Interpolate eight numbers between two frames into `to`. */
static inline simd_f64 mixed(double *to, const float *s0, const float *s1, double w0, double w1)
{
    simd_f64 const x = w0 * simd_f64_load_float(s0) + w1 * simd_f64_load_float(s1);
    simd_f64_store(to, x);
    return x;
}

void KERNEL(lift_eight)(double *out, const float *s0, const float *s1, double w0, double w1,
                        const double *theta, int32_t modes, double moved[CHOLESKY_LANES])
{
    for (int32_t c = 0; c < CHOLESKY_LANES; c += SIMD_F64) {
        simd_f64 sum0 = {0.0}, sum1 = {0.0};
        int32_t i = 0, at = c;
        for (; i + 2 <= modes; i += 2, at += 2 * CHOLESKY_LANES) {
            sum0 += mixed(out + at, s0 + at, s1 + at, w0, w1) * theta[i];
            sum1 +=
                mixed(out + at + CHOLESKY_LANES, s0 + at + CHOLESKY_LANES, s1 + at + CHOLESKY_LANES, w0, w1) *
                theta[i + 1];
        }
        if (i < modes)
            sum0 += mixed(out + at, s0 + at, s1 + at, w0, w1) * theta[i];
        simd_f64_store(moved + c, sum0 + sum1);
    }
}

void KERNEL(lift_turn)(float *v, size_t stride, size_t apart, const double *shape, int32_t modes,
                       double M[9][8])
{
    int32_t const plane = modes * CHOLESKY_LANES;
    for (int32_t c = 0; c < CHOLESKY_LANES; c += SIMD_F64) {
        simd_f64 m[9];
        _Pragma("GCC unroll 9") for (int32_t i = 0; i < 9; i++) m[i] = simd_f64_load(M[i] + c);
        const double *s = shape + c;
        float *to = v + c;
        for (int32_t i = 0; i < modes; i++, s += CHOLESKY_LANES, to += stride) {
            simd_f64 const x = simd_f64_load(s), y = simd_f64_load(s + plane),
                           z = simd_f64_load(s + 2 * plane);
            simd_f64_store_float(to, (m[0] * x + m[1] * y) + m[2] * z);
            simd_f64_store_float(to + apart, (m[3] * x + m[4] * y) + m[5] * z);
            simd_f64_store_float(to + 2 * apart, (m[6] * x + m[7] * y) + m[8] * z);
        }
    }
}

void KERNEL(lift_squares)(double *x, int32_t width, const float *Z, size_t stride, int32_t rows)
{
    for (int32_t j = 0; j < width; j += SIMD_F64) {
        simd_f64 sum = simd_f64_load(x + j);
        for (int32_t i = 0; i < rows; i++) {
            simd_f64 const z = simd_f64_load_float(Z + (size_t)i * stride + j);
            sum += z * z;
        }
        simd_f64_store(x + j, sum);
    }
}
