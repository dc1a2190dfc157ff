#include "model/kinematics.h"
#include "model/kinematics_simd.h"

#include <string.h>

/* Every channel of one body. */
static COLD void curves_at(const gait_model *all, const gait_state *s, float channel[MODEL_MAX_CHANNELS])
{
    const gait_model *const m = s->motion_class == all->motion_class ? all : all->of_class[s->motion_class];
    curves_part(m, s->phase, kin_pace(m, s->stride_hz), s->coef, 1, m->components, 0, m->channels, channel);
}

float kin_channel(const gait_model *m, int32_t channel, float phase, float pace, const float *coef,
                  int32_t components)
{
    float value;
    curves_part(m, phase, pace, coef, 1, components, channel, 1, &value);
    return value;
}

float kin_height_change(const gait_model *m, const float *score, int32_t proportions)
{
    float change = 0.0f;
    for (int32_t k = 0; k < proportions; k++)
        change += score[k] * m->proportion[k * (m->frames + 1) + m->frames];
    return change;
}

void kin_points(const gait_model *m, const kin_body *b, float (*xyz)[3][BLOCK])
{
    for (int32_t i = 0; i < m->points; i++) {
        int32_t const f = m->point_frame[i];
        place_point(b->R[f][0], b->o[f][0], b->scale[f], m->point_offset + 3 * i, xyz[i][0], BLOCK);
    }
}

COLD bool kin_state_usable(const gait_model *m, const gait_state *s)
{
    const float place[10] = {s->phase, s->stride_hz, s->stature,   s->heading,   s->pitch,
                             s->roll,  s->pelvis[0], s->pelvis[1], s->pelvis[2], s->turn_rate};
    return f_finite(place, 10) && f_finite(s->coef, GAIT_MAX_COMPONENTS) &&
           f_finite(s->offset, GAIT_MAX_ANGLES) && f_finite(s->proportion, GAIT_MAX_PROPORTIONS) &&
           s->stature > 0.0f && s->motion_class >= 0 && s->motion_class < m->classes;
}

/* Curves of one body into channel, then its frames. */
static COLD void place_state(const gait_model *m, const gait_state *s, float *channel, kin_frames *out)
{
    bodies const b = {.channel = channel,
                      .heading = &s->heading,
                      .pitch = &s->pitch,
                      .roll = &s->roll,
                      .pelvis = s->pelvis,
                      .stature = &s->stature,
                      .score = s->proportion,
                      .proportions = m->proportions,
                      .R = out->R,
                      .o = out->o,
                      .scale = out->scale};
    curves_at(m, s, channel);
    for (int32_t a = 0; a < m->angles; a++)
        channel[a] += s->offset[a];
    place_frames(m, &b, 1);
}

gait_result model_place_state(const gait_model *m, const gait_state *s, kin_frames *out)
{
    float channel[MODEL_MAX_CHANNELS];
    if (!kin_state_usable(m, s))
        return GAIT_ERR_ARG;
    place_state(m, s, channel, out);
    return GAIT_OK;
}

gait_result model_pose_state(const gait_model *m, const gait_state *s, gait_pose *out)
{
    float channel[MODEL_MAX_CHANNELS];
    kin_frames at;
    if (!kin_state_usable(m, s))
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

gait_result model_pelvis_height(const gait_model *m, const gait_state *s, float *out)
{
    if (!kin_state_usable(m, s))
        return GAIT_ERR_ARG;
    float channel[MODEL_MAX_CHANNELS];
    curves_at(m, s, channel);
    *out = s->stature * (1.0f + kin_height_change(m, s->proportion, m->proportions)) *
           channel[m->root_channel + ROOT_HEIGHT];
    return GAIT_OK;
}
