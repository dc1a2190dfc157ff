#include "kinematics.h"

#include "fmath.h"

#include <string.h>

/* The code is written once for n lanes; always inlined, so that n is a constant: BLOCK, or 1 for one body. */
#if defined(__GNUC__)
#define LANES static inline __attribute__((always_inline))
#else
#define LANES static inline
#endif

/* n bodies: component i of an array lies at [i * n + lane].  Shapes as in kin_input and kin_body. */
typedef struct bodies {
    const float *channel;                /* M x n */
    const float *heading, *pitch, *roll; /* n */
    const float *pelvis;                 /* 3 x n */
    float *R, *o, *scale;                /* F x 9 x n, F x 3 x n, F x n */
} bodies;

/* Channels first .. first + count - 1 of one body; component k's score is coef[k * stride]. */
static inline void curves_part(const gait_model *m, float phase, const float *coef, int32_t stride,
                               int32_t components, int32_t first, int32_t count, float *acc)
{
    int32_t const T = m->phases, M = m->channels;
    float const at = m_wrap1(phase) * (float)T;
    int32_t const j = i_min((int32_t)at, T - 1), next = j + 1 < T ? j + 1 : 0;
    float const w = at - (float)j;
    memset(acc, 0, (size_t)count * sizeof *acc);
    for (int32_t k = 0; k <= components; k++) {
        const float *const curve = m->curves + (size_t)k * (size_t)T * (size_t)M + first;
        const float *const a = curve + (size_t)j * (size_t)M, *const b = curve + (size_t)next * (size_t)M;
        float const c = k ? coef[(k - 1) * stride] : 1.0f, ca = c * (1.0f - w), cb = c * w;
        for (int32_t i = 0; i < count; i++)
            acc[i] += ca * a[i] + cb * b[i];
    }
}

static void curves_at(const gait_model *m, float phase, const float *coef, int32_t stride, int32_t components,
                      float acc[MODEL_MAX_CHANNELS])
{
    curves_part(m, phase, coef, stride, components, 0, m->channels, acc);
}

float kin_channel(const gait_model *m, int32_t channel, float phase, const float *coef, int32_t components)
{
    float value;
    curves_part(m, phase, coef, 1, components, channel, 1, &value);
    return value;
}

/* R = R Rot(axis, angle): it mixes the two columns other than axis (0..2). */
LANES void rotate(float *restrict R, int axis, const float *restrict angle, int n)
{
    float *restrict const a = R + (axis + 1) % 3 * n, *restrict const b = R + (axis + 2) % 3 * n;
    float s[BLOCK], c[BLOCK];
    for (int lane = 0; lane < n; lane++)
        m_sincos(angle[lane], &s[lane], &c[lane]);
    for (int row = 0; row < 9 * n; row += 3 * n)
        for (int lane = 0; lane < n; lane++) {
            float const x = a[row + lane], y = b[row + lane];
            a[row + lane] = c[lane] * x + s[lane] * y;
            b[row + lane] = c[lane] * y - s[lane] * x;
        }
}

/* Rz(heading + root_yaw) Ry(pitch + root_pitch) Rx(roll + root_roll) at the pelvis joint. */
LANES void place_root(const gait_model *m, const bodies *b, int n)
{
    const float *const root = b->channel + m->root_channel * n;
    const float *const own[3] = {root + ROOT_ROLL * n, root + ROOT_PITCH * n, root + ROOT_YAW * n};
    const float *const given[3] = {b->roll, b->pitch, b->heading};
    for (int i = 0; i < 9; i++)
        for (int lane = 0; lane < n; lane++)
            b->R[i * n + lane] = i % 4 ? 0.0f : 1.0f;
    for (int axis = 2; axis >= 0; axis--) {
        float angle[BLOCK];
        for (int lane = 0; lane < n; lane++)
            angle[lane] = given[axis][lane] + own[axis][lane];
        rotate(b->R, axis, angle, n);
    }
    memcpy(b->o, b->pelvis, 3 * (size_t)n * sizeof(float));
}

/* Metres per model length in every frame: stature, changed by the limbs' proportions. */
LANES void scale_frames(const gait_model *m, const float *stature, const float *score, int32_t proportions,
                        float *restrict scale, int n)
{
    for (int32_t f = 0; f < m->frames; f++)
        for (int lane = 0; lane < n; lane++) {
            float change = 1.0f;
            for (int32_t k = 0; k < proportions; k++)
                change += score[k * n + lane] * m->proportion[k * (m->frames + 1) + f];
            scale[f * n + lane] = stature[lane] * change;
        }
}

float kin_height_change(const gait_model *m, const float *score, int32_t proportions)
{
    float change = 0.0f;
    for (int32_t k = 0; k < proportions; k++)
        change += score[k] * m->proportion[k * (m->frames + 1) + m->frames];
    return change;
}

/* World position (3 x n) of a point given in a frame, statures: o + scale R p. */
LANES void place_point(const float *R, const float *o, const float *scale, const float p[3],
                       float *restrict out, int n)
{
    for (int k = 0; k < 3; k++)
        for (int lane = 0; lane < n; lane++) {
            const float *const r = R + 3 * k * n + lane;
            out[k * n + lane] = o[k * n + lane] + scale[lane] * (r[0] * p[0] + r[n] * p[1] + r[2 * n] * p[2]);
        }
}

LANES void place_frames(const gait_model *m, const bodies *b, int n)
{
    place_root(m, b, n);
    for (int32_t f = 1; f < m->frames; f++) {
        const int32_t *const info = m->frame_info + FRAME_INFO * f;
        float *const R = b->R + 9 * n * f;
        const float *const parent = b->R + 9 * n * info[0];
        place_point(parent, b->o + 3 * n * info[0], b->scale + n * info[0], m->frame_origin + 3 * f,
                    b->o + 3 * n * f, n);
        memcpy(R, parent, 9 * (size_t)n * sizeof(float));
        for (int32_t k = 0; k < info[1]; k++) {
            int32_t const axis = info[2 + 2 * k];
            float const sense = axis < 0 ? -1.0f : 1.0f;
            const float *const v = b->channel + info[3 + 2 * k] * n;
            float angle[BLOCK];
            for (int lane = 0; lane < n; lane++)
                angle[lane] = sense * v[lane];
            rotate(R, (axis < 0 ? -axis : axis) - 1, angle, n);
        }
    }
}

void kin_curves(const gait_model *m, const float phase[BLOCK], const float coef[][BLOCK], int32_t components,
                kin_channels *out)
{
    GAIT_ASSERT(components >= 0 && components <= m->components);
    for (int lane = 0; lane < BLOCK; lane++) {
        float acc[MODEL_MAX_CHANNELS];
        curves_at(m, phase[lane], &coef[0][lane], BLOCK, components, acc);
        for (int32_t i = 0; i < m->channels; i++)
            out->v[i][lane] = acc[i];
    }
}

void kin_pose(const gait_model *m, const kin_channels *ch, const kin_input *in, int32_t proportions,
              kin_body *out)
{
    bodies const b = {.channel = ch->v[0],
                      .heading = in->heading,
                      .pitch = in->pitch,
                      .roll = in->roll,
                      .pelvis = in->pelvis[0],
                      .R = out->R[0][0],
                      .o = out->o[0][0],
                      .scale = out->scale[0]};
    scale_frames(m, in->stature, in->proportion[0], proportions, b.scale, BLOCK);
    place_frames(m, &b, BLOCK);
}

void kin_points(const gait_model *m, const kin_body *b, float (*xyz)[3][BLOCK])
{
    for (int32_t i = 0; i < m->points; i++) {
        int32_t const f = m->point_frame[i];
        place_point(b->R[f][0], b->o[f][0], b->scale[f], m->point_offset + 3 * i, xyz[i][0], BLOCK);
    }
}

static bool state_usable(const gait_state *s)
{
    const float place[9] = {s->phase, s->stride_hz, s->stature,   s->heading,  s->pitch,
                            s->roll,  s->pelvis[0], s->pelvis[1], s->pelvis[2]};
    return f_finite(place, 9) && f_finite(s->coef, GAIT_MAX_COMPONENTS) &&
           f_finite(s->offset, GAIT_MAX_ANGLES) && f_finite(s->proportion, GAIT_MAX_PROPORTIONS) &&
           s->stature > 0.0f;
}

/* Curves of one body into channel, then its frames. */
static void place_state(const gait_model *m, const gait_state *s, float *channel, kin_frames *out)
{
    bodies const b = {.channel = channel,
                      .heading = &s->heading,
                      .pitch = &s->pitch,
                      .roll = &s->roll,
                      .pelvis = s->pelvis,
                      .R = out->R,
                      .o = out->o,
                      .scale = out->scale};
    curves_at(m, s->phase, s->coef, 1, m->components, channel);
    for (int32_t a = 0; a < m->angles; a++)
        channel[a] += s->offset[a];
    scale_frames(m, &s->stature, s->proportion, m->proportions, b.scale, 1);
    place_frames(m, &b, 1);
}

gait_status model_place_state(const gait_model *m, const gait_state *s, kin_frames *out)
{
    float channel[MODEL_MAX_CHANNELS];
    if (!state_usable(s))
        return GAIT_ERR_ARG;
    place_state(m, s, channel, out);
    return GAIT_OK;
}

gait_status model_pose_state(const gait_model *m, const gait_state *s, gait_pose *out)
{
    float channel[MODEL_MAX_CHANNELS];
    kin_frames at;
    if (!state_usable(s))
        return GAIT_ERR_ARG;
    place_state(m, s, channel, &at);
    memset(out, 0, sizeof *out);
    for (int32_t i = 0; i < m->points; i++) {
        int32_t const f = m->point_frame[i];
        place_point(at.R + 9 * f, at.o + 3 * f, &at.scale[f], m->point_offset + 3 * i, out->joint[i], 1);
    }
    memcpy(out->angle, channel, (size_t)m->angles * sizeof(float));
    return GAIT_OK;
}

gait_status model_pelvis_height(const gait_model *m, const gait_state *s, float *out)
{
    if (!state_usable(s))
        return GAIT_ERR_ARG;
    float channel[MODEL_MAX_CHANNELS];
    curves_at(m, s->phase, s->coef, 1, m->components, channel);
    *out = s->stature * (1.0f + kin_height_change(m, s->proportion, m->proportions)) *
           channel[m->root_channel + ROOT_HEIGHT];
    return GAIT_OK;
}
