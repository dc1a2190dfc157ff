#include "convert.h"

#include <math.h>
#include <string.h>

_Static_assert(sizeof((gaitmsg_state_t *)0)->coef == sizeof((gait_state *)0)->coef,
               "state_t holds every component");
_Static_assert(sizeof((gaitmsg_state_t *)0)->offset == sizeof((gait_state *)0)->offset,
               "state_t holds every angle");

/* Numbers with the same name in gait_state and state_t. */
#define SCALARS(X) X(phase) X(stride_hz) X(stature) X(heading) X(pitch) X(roll)

void convert_state(const gait_state *in, const gait_model_info *info, gaitmsg_state_t *out)
{
#define COPY(name) out->name = in->name;
    SCALARS(COPY)
    memcpy(out->pelvis, in->pelvis, sizeof out->pelvis);
    out->ncoef = info->components;
    memcpy(out->coef, in->coef, sizeof out->coef);
    out->noffset = info->angles;
    memcpy(out->offset, in->offset, sizeof out->offset);
}

static float known(float value, float unknown)
{
    return isnan(value) ? unknown : value;
}

bool convert_state_message(const gaitmsg_state_t *in, const gait_state *unknown, gait_state *out,
                           message *why)
{
    if (in->ncoef < 0 || in->ncoef > GAIT_MAX_COMPONENTS)
        return message_set(why, "state with ncoef %d; give 0 to %d", in->ncoef, GAIT_MAX_COMPONENTS);
    if (in->noffset < 0 || in->noffset > GAIT_MAX_ANGLES)
        return message_set(why, "state with noffset %d; give 0 to %d", in->noffset, GAIT_MAX_ANGLES);
    *out = (gait_state){.turn_rate = unknown->turn_rate}; /* messages do not state it */
#define TAKE(name) out->name = known(in->name, unknown->name);
    SCALARS(TAKE)
    for (int i = 0; i < 3; i++)
        out->pelvis[i] = known(in->pelvis[i], unknown->pelvis[i]);
    for (int i = 0; i < in->ncoef; i++)
        out->coef[i] = known(in->coef[i], unknown->coef[i]);
    for (int i = 0; i < in->noffset; i++)
        out->offset[i] = known(in->offset[i], unknown->offset[i]);
    return true;
}

void convert_estimate(const gait_model *model, const gait_model_info *info, const gait_estimate *in,
                      estimate_message *out)
{
    gaitmsg_estimate_t *const m = &out->msg;
    m->utime = in->utime;
    m->status = (int8_t)in->status;
    m->flags = (int32_t)in->flags;
    m->model_digest = (int64_t)info->digest;
    m->log_evidence = in->log_evidence;
    convert_state(&in->mean, info, &m->mean);
    convert_state(&in->sd, info, &m->sd);
    convert_state(&in->best, info, &m->best);
    m->ess = in->ess;
    m->phase_r = in->phase_r;
    m->mode_mass = in->hypothesis_weight;
    m->speed = in->speed;
    m->njoints = info->joints;
    m->joints = out->joint;
    for (int32_t j = 0; j < info->joints; j++) {
        out->joint[j].name =
            (char *)gait_model_joint_name(model, j); /* LCM's strings lack const; read only */
        memcpy(out->joint[j].position, in->pose.joint[j], sizeof out->joint[j].position);
        memcpy(out->joint[j].sd, in->joint_sd[j], sizeof out->joint[j].sd);
    }
    m->nangles = info->angles;
    m->angles = out->angle;
    for (int32_t a = 0; a < info->angles; a++)
        out->angle[a] = (gaitmsg_angle_t){(char *)gait_model_angle_name(model, a), in->pose.angle[a]};
}
