/* kinematics_simd.h - curves and forward kinematics of n bodies, one lane a body; inline, so that the loops
 * over lanes vectorise. */
#ifndef GAIT_MODEL_KINEMATICS_SIMD_H
#define GAIT_MODEL_KINEMATICS_SIMD_H
#include "base/fmath.h"
#include "base/dispatch.h"
#include "model/model.h"

#include <string.h>

/* The code is written for n lanes and always inlined, so that n is a constant: BLOCK, or 1 for one body. */
#if defined(__GNUC__)
#define KIN_INLINE static inline __attribute__((always_inline))
#else
#define KIN_INLINE static inline
#endif

/* n bodies: component i of an array is at [i * n + lane]. Shapes as in kin_input and kin_body. */
typedef struct bodies {
    const float *channel;                /* M x n */
    const float *heading, *pitch, *roll; /* n */
    const float *pelvis;                 /* 3 x n */
    const float *stature;                /* n */
    const float *score; /* p x n: scores of the proportions, of which the first `proportions` are used */
    int32_t proportions;
    float *R, *o, *scale; /* F x 9 x n, F x 3 x n, F x n */
} bodies;

/* Where on the curves a phase is: between two samples. */
typedef struct curve_place {
    size_t here, next; /* index of channel `first` in a curve's samples */
    float w;           /* weight of the next one */
} curve_place;

KIN_INLINE curve_place curve_place_of(const gait_model *m, float phase, int32_t first)
{
    int32_t const T = m->phases, M = m->channels;
    float const at = m_wrap1(phase) * (float)T;
    int32_t const j = i_min((int32_t)at, T - 1), next = j + 1 < T ? j + 1 : 0;
    return (curve_place){(size_t)j * (size_t)M + (size_t)first, (size_t)next * (size_t)M + (size_t)first,
                         at - (float)j};
}

/* Channels first .. first + count - 1 of one body; component k's score is coef[k * stride]. */
KIN_INLINE void curves_part(const gait_model *m, float phase, float pace, const float *coef, int32_t stride,
                            int32_t components, int32_t first, int32_t count, float *acc)
{
    curve_place const at = curve_place_of(m, phase, first);
    size_t const each = (size_t)m->phases * (size_t)m->channels;
    memset(acc, 0, (size_t)count * sizeof *acc);
    for (int32_t k = m->pace_curve ? -1 : 0; k <= components; k++) {
        const float *const curve = k < 0 ? m->pace_curve : m->curves + (size_t)k * each;
        const float *const a = curve + at.here, *const b = curve + at.next;
        float const c = k < 0 ? pace
                        : k   ? coef[(k - 1) * stride]
                              : 1.0f,
                    ca = c * (1.0f - at.w), cb = c * at.w;
        for (int32_t i = 0; i < count; i++)
            acc[i] += ca * a[i] + cb * b[i];
    }
}

/* Rotate (x, y) by the angle with this sine and cosine. */
KIN_INLINE void turn(float s, float c, float *x, float *y)
{
    float const was = *x;
    *x = c * was + s * *y;
    *y = c * *y - s * was;
}

/* Rotate columns a and b of R into each other by the angles with these sines and cosines. */
KIN_INLINE void turn_columns(float *R, int a, int b, const float *s, const float *c, int n)
{
    for (int lane = 0; lane < n; lane++) {
        turn(s[lane], c[lane], R + a * n + lane, R + b * n + lane);
        turn(s[lane], c[lane], R + (3 + a) * n + lane, R + (3 + b) * n + lane);
        turn(s[lane], c[lane], R + (6 + a) * n + lane, R + (6 + b) * n + lane);
    }
}

/* R = R Rot(axis, angle): it mixes the two columns other than axis (0..2). */
KIN_INLINE void rotate(float *R, int axis, const float *s, const float *c, int n)
{
    if (axis == 0)
        turn_columns(R, 1, 2, s, c, n);
    else if (axis == 1)
        turn_columns(R, 2, 0, s, c, n);
    else
        turn_columns(R, 0, 1, s, c, n);
}

/* Rz(heading + root_yaw) Ry(pitch + root_pitch) Rx(roll + root_roll) at the pelvis joint. */
KIN_INLINE void place_root(const gait_model *m, const bodies *b, int n)
{
    const float *const root = b->channel + m->root_channel * n;
    const float *const own[3] = {root + ROOT_ROLL * n, root + ROOT_PITCH * n, root + ROOT_YAW * n};
    const float *const given[3] = {b->roll, b->pitch, b->heading};
    for (int i = 0; i < 9; i++)
        for (int lane = 0; lane < n; lane++)
            b->R[i * n + lane] = i % 4 ? 0.0f : 1.0f;
    for (int axis = 2; axis >= 0; axis--) {
        float s[BLOCK], c[BLOCK];
        KERNEL_LANES
        for (int lane = 0; lane < n; lane++)
            m_sincos(given[axis][lane] + own[axis][lane], &s[lane], &c[lane]);
        rotate(b->R, axis, s, c, n);
    }
    memcpy(b->o, b->pelvis, 3 * (size_t)n * sizeof(float));
}

/* Metres per model length in every frame: the stature, changed by the limbs' proportions. */
KIN_INLINE void scale_frames(const gait_model *m, const bodies *b, int n)
{
    for (int32_t f = 0; f < m->frames; f++) {
        float change[BLOCK];
        for (int lane = 0; lane < n; lane++)
            change[lane] = 1.0f;
        for (int32_t k = 0; k < b->proportions; k++)
            for (int lane = 0; lane < n; lane++)
                change[lane] += b->score[k * n + lane] * m->proportion[k * (m->frames + 1) + f];
        for (int lane = 0; lane < n; lane++)
            b->scale[f * n + lane] = b->stature[lane] * change[lane];
    }
}

/* World position (3 x n) of a point given in a frame, statures: o + scale R p. */
KIN_INLINE void place_point(const float *R, const float *o, const float *scale, const float p[3],
                            float *restrict out, int n)
{
    for (int k = 0; k < 3; k++)
        for (int lane = 0; lane < n; lane++) {
            const float *const r = R + 3 * k * n + lane;
            out[k * n + lane] = o[k * n + lane] + scale[lane] * (r[0] * p[0] + r[n] * p[1] + r[2 * n] * p[2]);
        }
}

/* Shift the origin o (3 x n) of frame f in its parent's axes R by what the proportions require. */
KIN_INLINE void shift_origin(const gait_model *m, const bodies *b, int32_t f, const float *R,
                             float *restrict o, int n)
{
    for (int32_t k = 0; k < b->proportions; k++) {
        const float *const by = m->shift + 3 * (k * m->frames + f);
        if (by[0] == 0.0f && by[1] == 0.0f && by[2] == 0.0f)
            continue;
        for (int i = 0; i < 3; i++)
            for (int lane = 0; lane < n; lane++) {
                const float *const r = R + 3 * i * n + lane;
                o[i * n + lane] += b->stature[lane] * b->score[k * n + lane] *
                                   (r[0] * by[0] + r[n] * by[1] + r[2 * n] * by[2]);
            }
    }
}

KIN_INLINE void place_frames(const gait_model *m, const bodies *b, int n)
{
    scale_frames(m, b, n);
    place_root(m, b, n);
    for (int32_t f = 1; f < m->frames; f++) {
        const int32_t *const info = m->frame_info + FRAME_INFO * f;
        float *const R = b->R + 9 * n * f;
        const float *const parent = b->R + 9 * n * info[0];
        place_point(parent, b->o + 3 * n * info[0], b->scale + n * info[0], m->frame_origin + 3 * f,
                    b->o + 3 * n * f, n);
        if (m->shift)
            shift_origin(m, b, f, parent, b->o + 3 * n * f, n);
        memcpy(R, parent, 9 * (size_t)n * sizeof(float));
        for (int32_t k = 0; k < info[1]; k++) {
            int32_t const axis = info[2 + 2 * k];
            float const sense = axis < 0 ? -1.0f : 1.0f;
            const float *const v = b->channel + info[3 + 2 * k] * n;
            float s[BLOCK], c[BLOCK];
            KERNEL_LANES
            for (int lane = 0; lane < n; lane++)
                m_sincos(sense * v[lane], &s[lane], &c[lane]);
            rotate(R, (axis < 0 ? -axis : axis) - 1, s, c, n);
        }
    }
}
#endif
