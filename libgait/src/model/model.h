/* model.h - a checked model file as typed views. Lengths are fractions of stature, angles radians. */
#ifndef GAIT_MODEL_MODEL_H
#define GAIT_MODEL_MODEL_H
#include "base/arena.h"
#include "model/segment_prior.h"

enum {
    MODEL_MAX_FRAMES = 24,
    MODEL_MAX_LIMBS = 32,
    MODEL_MIN_PHASES = 8,
    MODEL_MAX_PHASES = 4096,
    MODEL_ROOT_CHANNELS = 6,
    MODEL_MAX_CHANNELS = GAIT_MAX_ANGLES + MODEL_ROOT_CHANNELS
};
/* Channels of the root, counted from root_channel. */
enum { ROOT_FORWARD, ROOT_SWAY, ROOT_HEIGHT, ROOT_ROLL, ROOT_PITCH, ROOT_YAW };
enum { LIMB_CONE = 0, LIMB_ELLIPSOID = 1 };
enum { FRAME_INFO = 8, FRAME_ROTATIONS = 3, LIMB_INFO = 2, LIMB_SHAPE = 10, MODEL_NAME = 32 };

struct gait_model {
    bool cyclic;            /* false: only a segment prior, what follows is 0 */
    segment_prior segments; /* markers 0: none */
    int32_t frames, points, limbs, angles;
    int32_t channels;     /* M = angles + MODEL_ROOT_CHANNELS */
    int32_t phases;       /* T */
    int32_t components;   /* q */
    int32_t proportions;  /* p */
    int32_t root_channel; /* index of root_forward; the other ROOT_* follow */

    const float *curves;       /* (1 + q) x T x M: mean, then component k times its standard deviation */
    const float *pace_series;  /* pace_terms x M: constant, then cosine and sine of each harmonic */
    int32_t pace_terms;        /* 1 + 2 x harmonics; 0: the mean is the same at every rate */
    const float *pace_curve;   /* T x M: change of the mean per unit of kin_pace; NULL: none */
    const float *channel_stat; /* M x 4: residual sd, smallest, largest, sd of the static offset */
    const float *score_stat;   /* q x 3: singular-value sd, between-subject sd, within-subject sd */

    /* p x (F + 1): relative change of the lengths in each frame, then of the pelvis's height, per standard
     * deviation; NULL if p is 0 */
    const float *proportion;
    const float *shift; /* p x F x 3: further shift of each frame's origin in its parent; may be NULL */

    float stride_hz, stride_hz_sd;         /* strides per second: mean, sd between subjects */
    float stride_cv;                       /* variation of the stride time within a subject */
    float stride_length, stride_length_sd; /* statures: mean, sd between subjects */
    float stature_mean, stature_sd;        /* metres, adults */

    const int32_t *frame_info;  /* F x 8: parent, rotations n, then n x (signed axis, channel) */
    const float *frame_origin;  /* F x 3, in the parent frame */
    const int32_t *point_frame; /* P */
    const float *point_offset;  /* P x 3, in its frame */
    const int32_t *limb_info;   /* L x 2: frame, LIMB_* */
    const float *limb_shape;    /* L x 10: start[3], end[3] in the frame, radii a0 b0 a1 b1 */

    const char (*channel_name)[MODEL_NAME]; /* M */
    const char (*frame_name)[MODEL_NAME];   /* F */
    const char (*point_name)[MODEL_NAME];   /* P */
    const char (*limb_name)[MODEL_NAME];    /* L */

    uint64_t digest; /* FNV-1a of the blob */

    /* Classes of motion: walking, standing ... (doc/method.md).  Each has its own view, which differs from this one in
     * curves, statistics and direction; the first is the model itself. */
    int32_t classes;                                     /* at least 1 */
    int32_t motion_class;                                /* of this view */
    int32_t direction;                                   /* of the phase: 1, -1 or 0 */
    const struct gait_model *of_class[GAIT_MAX_CLASSES]; /* all views */
    const char (*class_name)[MODEL_NAME];                /* NULL: one class without a name */
    const int32_t *class_info;                           /* C x CLASS_INFO */
    const float *class_change;                           /* C x C x CLASS_CHANGE; NULL with one class */
};

/* Columns of class_info and class_change. */
enum { CLASS_DIRECTION, CLASS_SOURCE, CLASS_CYCLES, CLASS_RECORDINGS, CLASS_INFO };
enum { CHANGE_RATE, CHANGE_CONCENTRATION, CHANGE_PHASE, CHANGE_SLOPE, CLASS_CHANGE };

/* Standard deviation between people of the posture of angle a, radians. */
static inline float model_posture_sd(const gait_model *m, int32_t a)
{
    float const learnt = m->channel_stat[4 * a + 3];
    return learnt > 0.0f ? learnt : 0.035f; /* 2 degrees, where too few people were recorded to estimate it */
}

/* Check a blob and fill m, one view for each class of motion, at most GAIT_MAX_CLASSES, without pace_curve; err names
 * the section at fault. */
gait_result model_open(const void *data, size_t bytes, gait_model *m, gait_error *err);

/* GAIT_ERR_ARG: the model has no cyclic part. */
gait_result model_need_cyclic(const gait_model *m, gait_error *err);

/* Index of the angle whose name is the first `length` characters of `name`; -1: there is none. */
int32_t model_find_angle(const gait_model *m, const char *name, size_t length);

/* Index of the name for the same part of the other side, such as r_knee for l_knee; i itself if there is none. */
int32_t model_other_side(const char (*name)[MODEL_NAME], int32_t names, int32_t i);

/* Mask of the angles of trunk and arms whose posture differs most between people. */
uint32_t model_posture_angles(const gait_model *m);

/* Copy the views m into the arena and compute their pace_curve. NULL when counting or on overflow. */
gait_model *model_layout(arena *a, const gait_model *m);
#endif
