/* kinematics.h - curves and forward kinematics of BLOCK bodies at once: structures of arrays, one lane a
 * body. Frames and signs: doc/model-format.md. The result of a lane does not depend on the other lanes. */
#ifndef GAIT_MODEL_KINEMATICS_H
#define GAIT_MODEL_KINEMATICS_H
#include "base/dispatch.h"
#include "base/fmath.h"
#include "model/model.h"

enum { KIN_MAX_FRAMES = MODEL_MAX_FRAMES };

typedef struct kin_input {
    float phase[BLOCK];                            /* cycles; wrapped to [0, 1) */
    float pace[BLOCK];                             /* of kin_pace */
    float stature[BLOCK];                          /* metres */
    float heading[BLOCK];                          /* radians */
    float pitch[BLOCK], roll[BLOCK];               /* radians, added to the model's own */
    float pelvis[3][BLOCK];                        /* metres, world */
    float coef[GAIT_MAX_COMPONENTS][BLOCK];        /* standard deviations */
    float proportion[GAIT_MAX_PROPORTIONS][BLOCK]; /* standard deviations */
} kin_input;

typedef struct kin_channels {
    float v[GAIT_MAX_ANGLES + 8][BLOCK]; /* radians or statures; order of gait_model.channel_name */
} kin_channels;

typedef struct kin_body {
    float R[KIN_MAX_FRAMES][9][BLOCK];  /* frame to world, row-major */
    float o[KIN_MAX_FRAMES][3][BLOCK];  /* origin of the frame, metres, world */
    float scale[KIN_MAX_FRAMES][BLOCK]; /* metres per model length in the frame */
} kin_body;

/* Stride rate relative to the mean, in standard deviations between people, limited to the learned range. 0
 * for a rate of 0, which means unknown. */
static inline float kin_pace(const gait_model *m, float stride_hz)
{
    float const most = 2.0f;
    if (!m->pace_curve || !(stride_hz > 0.0f))
        return 0.0f;
    return f_clamp((stride_hz - m->stride_hz) / m->stride_hz_sd, -most, most);
}

/* One channel of one body: the same bits as the kernel kin_curves. */
float kin_channel(const gait_model *m, int32_t channel, float phase, float pace, const float *coef,
                  int32_t components);

/* Relative change of the height of the pelvis due to the first `proportions` scores. */
float kin_height_change(const gait_model *m, const float *score, int32_t proportions);

/* The reported joints, metres, world: P x 3 x BLOCK. */
void kin_points(const gait_model *m, const kin_body *b, float (*xyz)[3][BLOCK]);

typedef struct kin_frames { /* the frames of one body in the world */
    float R[KIN_MAX_FRAMES * 9], o[KIN_MAX_FRAMES * 3];
    float scale[KIN_MAX_FRAMES]; /* metres per model length */
} kin_frames;

/* Whether all numbers of a state are finite, the stature is positive and the model has its class. */
bool kin_state_usable(const gait_model *m, const gait_state *s);

/* Frames of one body. Errors are those of model_pose_state. */
gait_result model_place_state(const gait_model *m, const gait_state *s, kin_frames *out);

/* Pose of one body: curves, kinematics, joints and angles; unused entries of out are 0. GAIT_ERR_ARG, with
 * out unchanged, if a number in s is not finite or the stature is not positive. */
gait_result model_pose_state(const gait_model *m, const gait_state *s, gait_pose *out);

/* Height of the pelvis above the ground that the curves give for s, metres. Errors are those of
 * model_pose_state. */
gait_result model_pelvis_height(const gait_model *m, const gait_state *s, float *out);
#endif
