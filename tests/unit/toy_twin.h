/* Forward kinematics of one body in double, with libm, straight from doc/model-format.md:
 *
 *   twin t;
 *   twin_pose(m, &state, &t);                   rotations and origins of every frame, metres
 */
#ifndef TOY_TWIN_H
#define TOY_TWIN_H

#include "model/kinematics.h"

#include <math.h>

typedef struct twin {
    double R[KIN_MAX_FRAMES][3][3], o[KIN_MAX_FRAMES][3];
} twin;

static inline double twin_channel(const gait_model *m, int channel, const gait_state *s)
{
    double const at = ((double)s->phase - floor((double)s->phase)) * m->phases;
    int const j = (int)at % m->phases, next = (j + 1) % m->phases;
    double const faster = ((double)s->stride_hz - (double)m->stride_hz) / (double)m->stride_hz_sd;
    double sum = 0.0;
    for (int k = m->pace_curve ? -1 : 0; k <= m->components; k++) {
        const float *const curve =
            (k < 0 ? m->pace_curve : m->curves + k * m->phases * m->channels) + channel;
        double const a = (double)curve[j * m->channels], b = (double)curve[next * m->channels];
        double const weight = k < 0 ? fmax(-2.0, fmin(faster, 2.0)) : k ? (double)s->coef[k - 1] : 1.0;
        sum += weight * (a + (at - floor(at)) * (b - a));
    }
    return sum;
}

/* R = R Rot(axis, angle), axis 1..3. */
static inline void twin_turn(double R[3][3], int axis, double angle)
{
    double const c = cos(angle), s = sin(angle);
    double const x[3][3] = {{1, 0, 0}, {0, c, -s}, {0, s, c}}, y[3][3] = {{c, 0, s}, {0, 1, 0}, {-s, 0, c}},
                 z[3][3] = {{c, -s, 0}, {s, c, 0}, {0, 0, 1}};
    const double (*const rot)[3] = axis == 1 ? x : axis == 2 ? y : z;
    double out[3][3] = {{0}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                out[i][j] += R[i][k] * rot[k][j];
    memcpy(R, out, sizeof out);
}

/* Metres per model length in a frame; frame F: of the pelvis's height. */
static inline double twin_scale(const gait_model *m, const gait_state *s, int frame)
{
    double change = 1.0;
    for (int k = 0; k < m->proportions; k++)
        change += (double)s->proportion[k] * (double)m->proportion[k * (m->frames + 1) + frame];
    return (double)s->stature * change;
}

static inline void twin_point(const twin *t, int frame, const float p[3], double scale, double out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = t->o[frame][i];
        for (int k = 0; k < 3; k++)
            out[i] += scale * t->R[frame][i][k] * (double)p[k];
    }
}

static inline void twin_shift(const gait_model *m, const gait_state *s, int parent, int f, twin *t)
{
    for (int n = 0; m->shift && n < m->proportions; n++)
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                t->o[f][i] += (double)s->stature * (double)s->proportion[n] * t->R[parent][i][k] *
                              (double)m->shift[3 * (n * m->frames + f) + k];
}

static inline void twin_pose(const gait_model *m, const gait_state *s, twin *t)
{
    double const given[3] = {(double)s->heading, (double)s->pitch, (double)s->roll};
    for (int f = 0; f < m->frames; f++) {
        const int32_t *const info = m->frame_info + FRAME_INFO * f;
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                t->R[f][i][k] = f ? t->R[info[0]][i][k] : i == k;
        for (int k = 0; k < info[1]; k++) {
            double const own = twin_channel(m, info[3 + 2 * k], s);
            twin_turn(t->R[f], abs(info[2 + 2 * k]), info[2 + 2 * k] < 0 ? -own : f ? own : own + given[k]);
        }
        if (f) {
            twin_point(t, info[0], m->frame_origin + 3 * f, twin_scale(m, s, info[0]), t->o[f]);
            twin_shift(m, s, info[0], f, t);
        } else
            for (int i = 0; i < 3; i++)
                t->o[0][i] = (double)s->pelvis[i];
    }
}

#endif
