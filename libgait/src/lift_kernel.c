/* Positions by modes: each coordinate is a sum in the order of the modes, so that lanes change nothing. */
#include "kernels.h"

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
