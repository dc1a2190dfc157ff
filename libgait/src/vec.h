/* vec.h - 3-vectors and row-major 3x3 matrices as plain float arrays.  out may not alias an argument. */
#ifndef GAIT_VEC_H
#define GAIT_VEC_H
#include "base.h"

static inline void v3_set(float out[3], float x, float y, float z)
{
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

static inline void v3_sub(float out[3], const float a[3], const float b[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] - b[i];
}

/* out = a + s b */
static inline void v3_madd(float out[3], const float a[3], float s, const float b[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] + s * b[i];
}

static inline float v3_dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void v3_cross(float out[3], const float a[3], const float b[3])
{
    v3_set(out, a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}

static inline float v3_norm(const float a[3])
{
    return sqrtf(v3_dot(a, a));
}

/* out = m v */
static inline void m3_mul_v(float out[3], const float m[9], const float v[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = m[3 * i] * v[0] + m[3 * i + 1] * v[1] + m[3 * i + 2] * v[2];
}

/* out = transpose(m) v */
static inline void m3_tmul_v(float out[3], const float m[9], const float v[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = m[i] * v[0] + m[i + 3] * v[1] + m[i + 6] * v[2];
}

static inline float m3_det(const float m[9])
{
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
}
#endif
