/* Curves and forward kinematics of BLOCK bodies. */
#include "base/dispatch.h"
#include "base/simd16.h"
#include "model/kinematics.h"
#include "model/kinematics_simd.h"

enum { PART = 16 }; /* channels computed at once */

#ifdef SIMD4_F
/* The sums of curves_part for PART channels, in registers. */
static inline void add_curves(const float *a, const float *b, float ca, float cb, simd4_f sum[PART / 4])
{
    simd4_f const fa = simd4_all(ca), fb = simd4_all(cb);
#pragma GCC unroll 4
    for (int32_t i = 0; i < PART / 4; i++)
        sum[i] += fa * simd4_load(a + 4 * i) + fb * simd4_load(b + 4 * i);
}

static void curves_of(const gait_model *m, float phase, float pace, const float *coef, int32_t components,
                      int32_t first, float *acc)
{
    curve_place const at = curve_place_of(m, phase, first);
    simd4_f sum[PART / 4] = {{0.0f}};
    size_t const each = (size_t)m->phases * (size_t)m->channels;
    if (m->pace_curve)
        add_curves(m->pace_curve + at.here, m->pace_curve + at.next, pace * (1.0f - at.w), pace * at.w, sum);
    add_curves(m->curves + at.here, m->curves + at.next, 1.0f - at.w, at.w, sum);
    for (int32_t k = 1; k <= components; k++) {
        const float *const curve = m->curves + (size_t)k * each;
        float const c = coef[(k - 1) * BLOCK];
        add_curves(curve + at.here, curve + at.next, c * (1.0f - at.w), c * at.w, sum);
    }
    memcpy(acc, sum, sizeof sum);
}
#else
static void curves_of(const gait_model *m, float phase, float pace, const float *coef, int32_t components,
                      int32_t first, float *acc)
{
    curves_part(m, phase, pace, coef, BLOCK, components, first, PART, acc);
}
#endif

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
            curves_of(m, in->phase[lane], in->pace[lane], &in->coef[0][lane], components, from,
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
