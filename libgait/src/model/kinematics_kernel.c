/* Curves and forward kinematics of BLOCK bodies. */
#include "base/dispatch.h"
#include "model/kinematics.h"
#include "model/kinematics_simd.h"

enum { PART = 16 }; /* channels computed at once */

/* Curves of a model with fewer than PART channels. */
KERNEL_ROW void few_curves(const gait_model *m, const kin_input *in, int32_t components, kin_channels *out)
{
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        float coef[GAIT_MAX_COMPONENTS];
        for (int32_t k = 0; k < components; k++)
            coef[k] = in->coef[k][lane];
        for (int32_t i = 0; i < m->channels; i++)
            out->v[i][lane] = kin_channel(m, i, in->phase[lane], in->pace[lane], coef, components);
    }
}

void KERNEL(kin_curves)(const gait_model *m, const kin_input *in, int32_t components, kin_channels *out)
{
    GAIT_ASSERT(components >= 0 && components <= m->components);
    float acc[BLOCK][MODEL_MAX_CHANNELS];
    if (m->channels < PART) {
        few_curves(m, in, components, out);
        return;
    }
    for (int32_t first = 0; first < m->channels; first += PART) {
        int32_t const from = i_min(first, m->channels - PART); /* the last part overlaps the one before */
        for (int32_t lane = 0; lane < BLOCK; lane++)
            curves_part(m, in->phase[lane], in->pace[lane], &in->coef[0][lane], BLOCK, components, from, PART,
                        acc[lane] + from);
    }
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
