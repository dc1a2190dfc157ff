#include "lift_service.h"

#include "convert.h"
#include "gaitmsg_estimate_t.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    MESSAGE_BYTES = 1 << 14, /* more than an estimate of all markers takes */
    BACK_US = 1000000, /* keypoints that are older than the last ones by more than this restart the stream */
};

bool lift_service_open(lift_service *s, const char *model, const lift_settings *set, sink *out, message *why)
{
    gait_error err = {.text = ""};
    gait_lift_config *const c = &s->config;
    s->out = out;
    s->person = set->person;
    s->last = -1;
    gait_lift_default(c);
    c->stature = (double)set->stature;
    if (set->sd > 0)
        c->sd = (double)set->sd;
    if (set->lag >= 0)
        c->lag = set->lag;
    c->cpu_mask = set->cpu_mask;
    /* the memory does not depend on the camera */
    c->camera = (gait_camera){.width = 1, .height = 1, .fx = 1, .fy = 1, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    if (!model_file_open(&s->file, model, why))
        return false;
    if (gait_lift_get_info(s->file.model, &s->info, &err) != GAIT_OK ||
        gait_lift_bytes(s->file.model, c, &s->memory_bytes, &err) != GAIT_OK)
        return message_set(why, "--lift: %.100s: %.120s", model, err.text);
    s->memory = aligned_memory(s->memory_bytes, "--lift", why);
    return s->memory;
}

void lift_service_close(lift_service *s)
{
    free(s->memory);
    model_file_close(&s->file);
    *s = (lift_service){0};
}

bool lift_service_camera(lift_service *s, const gait_camera *camera, message *why)
{
    gait_error err = {.text = ""};
    gait_lift_config c = s->config;
    c.camera = *camera;
    if (gait_lift_init(s->memory, s->memory_bytes, s->file.model, &c, &s->lift, &err) != GAIT_OK)
        return message_set(why, "--lift: %s", err.text);
    s->config = c;
    s->last = -1;
    return true;
}

/* Index of a marker by name, or -1. */
static int32_t find(const lift_service *s, const char *name)
{
    for (int32_t j = 0; j < s->info.markers; j++)
        if (strcmp(gait_lift_marker_name(s->lift, j), name) == 0)
            return j;
    return -1;
}

/* Observations by marker.  Returns how many keypoints the prior knows. */
static int32_t take(lift_service *s, keypoints_view *v)
{
    keypoint_view k;
    int32_t known = 0;
    double const step = s->last < 0 ? 0.0 : 1e-6 * (double)(v->utime - s->last);
    for (int32_t j = 0; j < s->info.markers; j++)
        s->sd[j] = -1.0;
    keypoints_filter_begin(&s->filter);
    while (keypoints_view_next(v, &k)) {
        int32_t const j = find(s, k.name);
        known += j >= 0;
        if (!keypoints_filter_pass(&s->filter, &k, j))
            continue;
        s->uv[2 * j] = (double)k.u;
        s->uv[2 * j + 1] = (double)k.v;
        s->sd[j] = keypoints_view_independent_sd(&k, s->config.sd, step);
    }
    return known;
}

/* The frame captured at `utime`, one of the last. */
static const lift_past *past_of(const lift_service *s, int64_t utime)
{
    for (int32_t i = 0; i < LIFT_SERVICE_PAST; i++)
        if (s->past[i].utime == utime)
            return &s->past[i];
    return &s->past[s->frames % LIFT_SERVICE_PAST];
}

static bool finite_joints(const gaitmsg_estimate_t *m)
{
    bool finite = isfinite(m->mean.heading);
    for (int32_t j = 0; j < m->njoints; j++)
        for (int32_t i = 0; i < 3; i++)
            finite = finite && isfinite(m->joints[j].position[i]) && isfinite(m->joints[j].sd[i]);
    return finite;
}

/* Forget keypoints that gave no usable estimate. */
static bool restart(lift_service *s, const char *reason, message *why)
{
    gait_lift_reset(s->lift);
    s->rejected++;
    return message_set(why, "keypoints: %s; the lift restarts", reason);
}

/* Publish the estimate if it is finite. */
static bool send(lift_service *s, int64_t step_us, message *why)
{
    static uint8_t encoded[MESSAGE_BYTES];
    const gait_lift_frame *const e = &s->estimate;
    const lift_past *const past = past_of(s, e->utime);
    bool const known = e->status != GAIT_TRACK_INIT; /* in INIT there are no joints yet */
    gaitmsg_estimate_t m = {.utime = e->utime,
                            .frame = past->frame,
                            .step = (int64_t)e->frame,
                            .receive_utime = past->receive_utime,
                            .step_us = (int32_t)step_us,
                            .status = (int8_t)e->status,
                            .model_digest = (int64_t)s->info.digest,
                            .njoints = known ? s->info.markers : 0,
                            .joints = s->joint};
    m.flags = e->flags & GAIT_LIFT_UNOBSERVED ? GAITMSG_ESTIMATE_T_FLAG_NO_IMAGE : 0;
    m.mean.heading = (float)e->heading;
    m.mean.stature = (float)(s->config.stature > 0.0 ? s->config.stature : (double)s->info.stature);
    for (int32_t j = 0; j < m.njoints; j++) {
        s->joint[j].name =
            (char *)gait_lift_marker_name(s->lift, j); /* LCM's strings lack const; read only */
        for (int32_t i = 0; i < 3; i++) {
            s->joint[j].position[i] = (float)e->marker[j][i];
            s->joint[j].sd[i] = (float)e->sd[j][i];
        }
    }
    if (!finite_joints(&m))
        return restart(s, "joints are not finite", why);
    sink_publish(s->out, "GAIT_LIFT", s->person, encoded,
                 gaitmsg_estimate_t_encode(encoded, 0, MESSAGE_BYTES, &m));
    s->lifted++;
    return true;
}

/* Whether keypoints of this time can follow the last ones, if necessary as a new stream. */
static bool in_time(lift_service *s, int64_t utime, message *why)
{
    if (utime < 0 || (utime <= s->last && utime >= s->last - BACK_US))
        return message_set(why, "keypoints: capture time did not advance; stamp them in order");
    if (utime > s->last)
        return true;
    gait_lift_reset(s->lift);
    if (!s->reported_back)
        log_event("keypoints: capture time went back by %.3f s: the lift restarts",
                  1e-6 * (double)(s->last - utime));
    s->reported_back = true;
    return true;
}

bool lift_service_keypoints(lift_service *s, keypoints_view *v, int64_t receive_utime, message *why)
{
    gait_error err = {.text = ""};
    if (!s->lift)
        return true; /* the camera is announced every few seconds */
    s->frames++;
    int32_t const announced = v->count;
    if (take(s, v) == 0 && announced > 0) {
        s->rejected++;
        return keypoints_view_unknown(why);
    }
    if (!in_time(s, v->utime, why)) {
        s->rejected++;
        return false;
    }
    int64_t const before = clock_monotonic();
    s->last = v->utime;
    if (gait_lift_push(s->lift, v->utime, s->uv, s->sd, &err) != GAIT_OK) {
        s->rejected++;
        return message_set(why, "keypoints: %s", err.text);
    }
    s->past[s->frames % LIFT_SERVICE_PAST] = (lift_past){v->utime, v->frame, receive_utime};
    gait_result const found = gait_lift_estimate(s->lift, &s->estimate, &err);
    int64_t const step_us = clock_monotonic() - before;
    histogram_add(&s->step, step_us);
    if (found == GAIT_ERR_STATE) /* too few frames yet */
        return true;
    return found == GAIT_OK ? send(s, step_us, why) : restart(s, err.text, why);
}
