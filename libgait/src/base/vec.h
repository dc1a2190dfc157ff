/* vec.h - 3-vectors and row-major 3x3 matrices as plain float arrays. */
#ifndef GAIT_BASE_VEC_H
#define GAIT_BASE_VEC_H
#include "base/base.h"

static inline float v3_dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline float m3_det(const float m[9])
{
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
}
#endif
