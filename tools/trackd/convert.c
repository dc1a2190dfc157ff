#include "convert.h"

#include "input_files.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

_Static_assert(sizeof((gaitmsg_state_t *)0)->coef == sizeof((gait_state *)0)->coef,
               "state_t holds every component");
_Static_assert(sizeof((gaitmsg_state_t *)0)->offset == sizeof((gait_state *)0)->offset,
               "state_t holds every angle");

/* Numbers that gait_state and state_t call alike. */
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
    *out = (gait_state){0};
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

bool convert_same_camera(const gait_camera *a, const gait_camera *b)
{
    enum { BEGIN = offsetof(gait_camera, fx), NUMBERS = (sizeof *a - BEGIN) / sizeof(float) };
    float x[NUMBERS], y[NUMBERS];
    memcpy(x, (const char *)a + BEGIN, sizeof x);
    memcpy(y, (const char *)b + BEGIN, sizeof y);
    bool same = a->width == b->width && a->height == b->height;
    for (int k = 0; k < NUMBERS; k++)
        same = same && fabsf(x[k] - y[k]) <= 1e-5f * fmaxf(1.0f, fabsf(x[k]));
    return same;
}

bool camera_check(const gait_camera *c, int32_t max_pixels, message *why)
{
    if (c->width < 1 || c->height < 1 || c->width > GAIT_MAX_PIXELS || c->height > GAIT_MAX_PIXELS)
        return message_set(why, "camera with a size of %dx%d; send 1 to %d", c->width, c->height,
                           GAIT_MAX_PIXELS);
    if (c->width * c->height > max_pixels)
        return message_set(why, "camera with %dx%d pixels, more than the %d of --max-pixels", c->width,
                           c->height, max_pixels);
    if (!(c->fx > 0) || !(c->fy > 0))
        return message_set(why, "camera with focal lengths %g and %g; send pixels", (double)c->fx,
                           (double)c->fy);
    return camera_rotation_ok(c) ||
           message_set(why, "camera whose R is not a rotation; send orthogonal rows of length 1");
}

bool convert_camera_message(const gaitmsg_camera_t *in, int32_t max_pixels, gait_camera *out, message *why)
{
    gait_camera c = {.width = in->width,
                     .height = in->height,
                     .fx = (float)in->fx,
                     .fy = (float)in->fy,
                     .cx = (float)in->cx,
                     .cy = (float)in->cy};
    for (int i = 0; i < 9; i++)
        c.R[i] = (float)in->R[i];
    for (int i = 0; i < 3; i++)
        c.t[i] = (float)in->t[i];
    for (int i = 0; i < 5; i++)
        c.distortion[i] = (float)in->distortion[i];
    if (!camera_check(&c, max_pixels, why))
        return false;
    *out = c;
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
