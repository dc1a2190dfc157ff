#include "service_send.h"

#include "gaitmsg_stride_t.h"

#include <stdio.h>

enum { MESSAGE_ROOM = 1 << 16 }; /* estimate and status, with room to spare */

static void send_particles(service *s, const image_view *v)
{
    int32_t const n = gait_tracker_particles(s->track.tracker, s->hypothesis, s->cloud.weight, s->hypotheses, NULL);
    s->cloud.utime = v->utime;
    s->cloud.frame = v->frame;
    s->cloud.n = n < 0 ? 0 : n;
    for (int32_t i = 0; i < s->cloud.n; i++)
        convert_state(&s->hypothesis[i], &s->track.info, &s->cloud.state[i]);
    sink_publish(s->out, "GAIT_PARTICLES", s->particles,
                 gaitmsg_particles_t_encode(s->particles, 0, (int)s->particles_bytes, &s->cloud));
}

/* Number the message as the source and the stream number the frame. */
static void number(gaitmsg_estimate_t *m, const service *s, const past_frame *p)
{
    m->frame = p->frame;
    m->step = p->number;
    m->dropped = s->counts.dropped - s->dropped_before;
    m->receive_utime = p->receive_utime;
    m->step_us = p->step_us;
    m->tracker_digest = (int64_t)gait_tracker_digest(s->track.tracker);
}

/* The stride that ends with an estimate, if one does. */
static void send_stride(service *s, const gait_estimate *e, int64_t frame)
{
    uint8_t bytes[256];
    stride found;
    if (!stride_meter_add(&s->meter, e, &found))
        return;
    gaitmsg_stride_t const m = {
        .utime = found.utime,
        .start_utime = found.start_utime,
        .other_utime = found.other_utime,
        .frame = frame,
        .side = found.side == STRIDE_RIGHT ? GAITMSG_STRIDE_T_RIGHT : GAITMSG_STRIDE_T_LEFT,
        .sure = found.sure,
        .end_sd = found.end_sd,
        .start_sd = found.start_sd,
        .other_sd = found.other_sd,
        .stride_time = found.time,
        .stride_time_sd = found.time_sd,
        .cadence = found.cadence,
        .cadence_sd = found.cadence_sd,
        .stride_length = found.length,
        .stride_length_sd = found.length_sd,
        .speed = found.speed,
        .speed_sd = found.speed_sd,
    };
    sink_publish(s->out, "GAIT_STRIDE", bytes, gaitmsg_stride_t_encode(bytes, 0, sizeof bytes, &m));
}

/* The frame of `lag` steps ago as it looks now; steps without a frame of their own are passed over. */
static void send_lagged(service *s)
{
    static uint8_t room[MESSAGE_ROOM];
    static estimate_message lagged;
    gait_estimate e;
    if (gait_tracker_lagged(s->track.tracker, s->track.config.lag, &e, NULL) != GAIT_OK)
        return;
    const past_frame *const p = &s->past[e.frame % SERVICE_PAST];
    if (p->step != e.frame)
        return;
    convert_estimate(s->track.model, &s->track.info, &e, &lagged);
    number(&lagged.msg, s, p);
    sink_publish(s->out, "GAIT_ESTIMATE_LAG", room,
                 gaitmsg_estimate_t_encode(room, 0, MESSAGE_ROOM, &lagged.msg));
    send_stride(s, &e, p->frame);
}

void service_send_estimate(service *s, const image_view *v, const gait_estimate *e, int64_t received,
                           int64_t step_us)
{
    static uint8_t room[MESSAGE_ROOM];
    gaitmsg_estimate_t *const m = &s->estimate.msg;
    convert_estimate(s->track.model, &s->track.info, e, &s->estimate);
    past_frame *const now = &s->past[e->frame % SERVICE_PAST];
    *now = (past_frame){e->frame, v->frame, s->steps, received, (int32_t)step_us};
    number(m, s, now);
    sink_publish(s->out, "GAIT_ESTIMATE", room, gaitmsg_estimate_t_encode(room, 0, MESSAGE_ROOM, m));
    if (s->track.config.lag > 0)
        send_lagged(s);
    else
        send_stride(s, e, v->frame);
    if (s->particles)
        send_particles(s, v);
}

void service_send_status(service *s)
{
    static uint8_t room[MESSAGE_ROOM];
    char version[32];
    const histogram *const st = &s->counts.step, *const la = &s->counts.latency;
    uint32_t const v = gait_version();
    snprintf(version, sizeof version, "%u.%u.%u", v / 10000, v / 100 % 100, v % 100);
    gaitmsg_status_t const msg = {
        .utime = service_now(),
        .version = version,
        .model_digest = (int64_t)s->track.info.digest,
        .tracker_digest = (int64_t)service_digest(s),
        .state = s->state,
        .background_mask = s->track.background.data ? 1 << s->stream : 0,
        .command_id = s->command_id,
        .frames = s->counts.frames,
        .dropped = s->counts.dropped,
        .rejected = s->counts.rejected,
        .particles = s->wanted ? s->wanted : s->track.config.particles,
        .threads = s->threads,
        .step_us_median = histogram_quantile(st, 0.5),
        .step_us_p99 = histogram_quantile(st, 0.99),
        .step_us_max = st->largest,
        .latency_us_median = histogram_quantile(la, 0.5),
        .latency_us_p99 = histogram_quantile(la, 0.99),
        .latency_us_max = la->largest,
        .memory_bytes = (int64_t)s->track.memory_bytes,
        .text = s->text.text,
    };
    sink_publish(s->out, "GAIT_STATUS", room, gaitmsg_status_t_encode(room, 0, MESSAGE_ROOM, &msg));
    s->news = false;
}
