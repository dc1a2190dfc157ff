#include "service_send.h"

#include <stdio.h>

enum { MESSAGE_ROOM = 1 << 16 }; /* estimate and status, with room to spare */

static void publish(service *s, const char *channel, const uint8_t *bytes, int size)
{
    if (s->out && size > 0)
        lcm_publish(s->out, channel, bytes, (unsigned)size);
}

static void send_particles(service *s, const image_view *v)
{
    int32_t const n =
        gait_tracker_particles(s->track.tracker, s->hypothesis, s->cloud.weight, s->track.config.particles);
    s->cloud.utime = v->utime;
    s->cloud.frame = v->frame;
    s->cloud.n = n < 0 ? 0 : n;
    for (int32_t i = 0; i < s->cloud.n; i++)
        convert_state(&s->hypothesis[i], &s->track.info, &s->cloud.state[i]);
    publish(s, "GAIT_PARTICLES", s->particles,
            gaitmsg_particles_t_encode(s->particles, 0, (int)s->particles_bytes, &s->cloud));
}

void service_send_estimate(service *s, const image_view *v, const gait_estimate *e, int64_t received,
                           int64_t step_us)
{
    static uint8_t room[MESSAGE_ROOM];
    gaitmsg_estimate_t *const m = &s->estimate.msg;
    convert_estimate(s->track.model, &s->track.info, e, &s->estimate);
    m->frame = v->frame;
    m->step = s->steps;
    m->dropped = s->counts.dropped - s->dropped_before;
    m->receive_utime = received;
    m->step_us = (int32_t)step_us;
    m->tracker_digest = (int64_t)gait_tracker_digest(s->track.tracker);
    publish(s, "GAIT_ESTIMATE", room, gaitmsg_estimate_t_encode(room, 0, MESSAGE_ROOM, m));
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
        .particles = s->track.config.particles,
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
    publish(s, "GAIT_STATUS", room, gaitmsg_status_t_encode(room, 0, MESSAGE_ROOM, &msg));
    s->news = false;
}
