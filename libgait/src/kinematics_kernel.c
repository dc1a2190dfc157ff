/* Curves and forward kinematics of BLOCK bodies. */
#include "kernels.h"
#include "kin_lanes.h"

void KERNEL(kin_curves)(const gait_model *m, const kin_input *in, int32_t components, kin_channels *out)
{
    GAIT_ASSERT(components >= 0 && components <= m->components);
    float acc[BLOCK][MODEL_MAX_CHANNELS];
    for (int32_t lane = 0; lane < BLOCK; lane++)
        curves_part(m, in->phase[lane], in->pace[lane], &in->coef[0][lane], BLOCK, components, 0, m->channels,
                    acc[lane]);
    for (int32_t i = 0; i < m->channels; i++)
        for (int32_t lane = 0; lane < BLOCK; lane++)
            out->v[i][lane] = acc[lane][i];
}

void KERNEL(kin_pose)(const gait_model *m, const kin_channels *ch, const kin_input *in, int32_t proportions,
                      kin_body *out)
{
    bodies const b = {.channel = ch->v[0],
                      .heading = in->heading,
                      .pitch = in->pitch,
                      .roll = in->roll,
                      .pelvis = in->pelvis[0],
                      .stature = in->stature,
                      .score = in->proportion[0],
                      .proportions = proportions,
                      .R = out->R[0][0],
                      .o = out->o[0][0],
                      .scale = out->scale[0]};
    place_frames(m, &b, BLOCK);
}
