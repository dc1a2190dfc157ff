#define _GNU_SOURCE /* ppoll */
#include "receiver.h"

#include "byte_reader.h"
#include "lcm_link.h"
#include "manager.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    FRAMES_WAITING = 64, /* two seconds of frames, of which the tracker takes the last */
    OTHERS_WAITING = 256,
    STATUS_US = 1000000, /* between two messages of GAIT_STATUS, */
    NEWS_US = 50000,     /* also if there is news */
};

#define DAMAGED "%.40s: damaged message or another version of its type"

static bool open_view(service *s, const lcm_recv_buf_t *buf, const char *channel, image_view *v)
{
    message why;
    if (image_view_open(v, buf->data, buf->data_size, &why))
        return true;
    s->counts.rejected++;
    service_complain(s, "%.40s: %.180s", channel, why.text);
    return false;
}

static bool newest(const receiver *r)
{
    return r->log || lcm_subscription_get_queue_size(r->frames) == 0;
}

/* Track the waiting frame, if there is one. */
static void flush_held(receiver *r)
{
    frame_hold *const hold = &r->service->shared->hold;
    image_view v;
    message why;
    if (hold->bytes && image_view_open(&v, hold->frame, hold->bytes, &why))
        service_frame(r->service, &v, newest(r), hold->arrival);
    hold->bytes = 0;
}

/* Track the waiting frame if everything that it waits for has arrived. */
static void flush_complete(receiver *r)
{
    const frame_hold *const hold = &r->service->shared->hold;
    if (hold->bytes && !service_waits(r->service, hold->utime))
        flush_held(r);
}

/* The service of the person whose number ends the channel. */
static service *service_of(const receiver *r, const char *channel)
{
    const char *const end = strrchr(channel, '_');
    service *s = r->service;
    for (service *each = s; end && each; each = each->next)
        s = each->person == atoi(end + 1) ? each : s;
    return s;
}

static void on_frame(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    receiver *const r = user;
    image_view v;
    flush_held(r);
    r->service->shared->arrived++;
    if (!open_view(r->service, buf, channel, &v))
        return;
    if (!service_waits(r->service, v.utime) ||
        !frame_hold_keep(&r->service->shared->hold, v.utime, buf->data, buf->data_size, buf->recv_utime))
        service_frame(r->service, &v, newest(r), buf->recv_utime);
}

static void on_background(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    receiver *const r = user;
    image_view v;
    if (open_view(r->service, buf, channel, &v))
        service_background(r->service, &v);
}

static void on_keypoints(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    receiver *const r = user;
    service *const s = service_of(r, channel);
    keypoint_cue *const cue = s->cue;
    keypoints_view v;
    message why;
    if (!keypoints_view_open(&v, buf->data, buf->data_size, &why)) {
        service_complain(s, "%.40s: %.180s", channel, why.text);
        return;
    }
    keypoints_view again = v; /* each reader consumes its view */
    if (s->shared->lift && !lift_service_keypoints(s->shared->lift, &v, buf->recv_utime, &why))
        service_complain(s, "%.40s: %.180s", channel, why.text);
    if (cue && !keypoint_cue_take(cue, &again, &why))
        service_complain(s, "%.40s: %.180s", channel, why.text);
    flush_complete(r);
}

/* The further camera of a channel; NULL: it is the first camera's. */
static further_camera *further_of(const receiver *r, const char *channel)
{
    further *const f = r->service->shared->further;
    return f ? further_find(f, atoi(strrchr(channel, '_') + 1)) : NULL;
}

static void on_camera(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    receiver *const r = user;
    gaitmsg_camera_t msg;
    if (gaitmsg_camera_t_decode(buf->data, 0, (int)buf->data_size, &msg) < 0)
        service_complain(r->service, DAMAGED, channel);
    else /* liblcm does not report when a message of a log arrived */
        service_camera(r->service, further_of(r, channel), &msg,
                       !r->log         ? clock_monotonic()
                       : msg.utime < 0 ? 0
                                       : msg.utime);
    flush_complete(r);
}

static void on_further_frame(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    receiver *const r = user;
    image_view v;
    message why;
    if (!open_view(r->service, buf, channel, &v))
        return;
    if (!further_take_frame(further_of(r, channel), &v, &why)) {
        r->service->counts.rejected++;
        service_complain(r->service, "%.40s: %.180s", channel, why.text);
    }
    flush_complete(r);
}

static void on_further_background(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    receiver *const r = user;
    image_view v;
    if (open_view(r->service, buf, channel, &v))
        service_further_background(r->service, further_of(r, channel), &v);
}

static void on_command(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    receiver *const r = user;
    gaitmsg_command_t msg;
    if (gaitmsg_command_t_decode(buf->data, 0, (int)buf->data_size, &msg) < 0)
        service_complain(service_of(r, channel), DAMAGED, channel);
    else
        service_command(service_of(r, channel), &msg);
}

static void on_status(const lcm_recv_buf_t *buf, const char *channel, void *user)
{
    receiver *const r = user;
    byte_reader bytes = {buf->data, buf->data_size, true};
    int64_t const type = bytes_int(&bytes, 8), utime = bytes_int(&bytes, 8);
    if (bytes.ok && type == __gaitmsg_status_t_get_hash()) /* otherwise it is of another version */
        service_status(service_of(r, channel), utime);
}

static bool subscribe_further(receiver *r, message *why)
{
    static const struct {
        const char *channel;
        lcm_msg_handler_t fn;
    } kinds[] = {{"GAIT_CAMERA", on_camera},
                 {"GAIT_BACKGROUND", on_further_background},
                 {"GAIT_IMAGE", on_further_frame}};
    const further *const f = r->service->shared->further;
    bool ok = true;
    for (int i = 0; f && i < f->count; i++)
        for (size_t k = 0; ok && k < sizeof kinds / sizeof *kinds; k++) {
            char name[32];
            snprintf(name, sizeof name, "%s_%d", kinds[k].channel, f->camera[i].stream);
            ok = link_subscribe(r->others, name, kinds[k].fn, r, FRAMES_WAITING, why) != NULL;
        }
    return ok;
}

/* Channels of one person. */
static bool subscribe_person(receiver *r, const service *s, message *why)
{
    char tracks[32], name[3][LINK_CHANNEL];
    snprintf(tracks, sizeof tracks, "GAIT_TRACKS_%d", r->service->shared->stream);
    return ((!s->shared->lift && !s->cue) ||
            link_subscribe(r->others, link_channel(tracks, s->person, name[0]), on_keypoints, r,
                           OTHERS_WAITING, why)) &&
           link_subscribe(r->others, link_channel("GAIT_COMMAND", s->person, name[1]), on_command, r,
                          OTHERS_WAITING, why) &&
           (r->log || link_subscribe(r->others, link_channel("GAIT_STATUS", s->person, name[2]), on_status, r,
                                     OTHERS_WAITING, why));
}

static bool subscribe(receiver *r, message *why)
{
    int const camera = r->service->shared->stream;
    char name[3][32];
    snprintf(name[0], sizeof name[0], "GAIT_IMAGE_%d", camera);
    snprintf(name[1], sizeof name[1], "GAIT_CAMERA_%d", camera);
    snprintf(name[2], sizeof name[2], "GAIT_BACKGROUND_%d", camera);
    r->frames = link_subscribe(r->images, name[0], on_frame, r, FRAMES_WAITING, why);
    bool ok = r->frames && subscribe_further(r, why) &&
              link_subscribe(r->others, name[1], on_camera, r, OTHERS_WAITING, why) &&
              link_subscribe(r->others, name[2], on_background, r, OTHERS_WAITING, why);
    for (const service *each = r->service; ok && each; each = each->next)
        ok = subscribe_person(r, each, why);
    return ok;
}

bool receiver_open(receiver *r, service *s, snapshot_file *snapshot, const char *url, message *why)
{
    *r = (receiver){.service = s, .log = link_is_log(url), .snapshot = snapshot};
    r->images = link_open(url, why);
    if (!r->images)
        return false;
    r->others = r->log ? r->images : link_open(url, why);
    return r->others && subscribe(r, why);
}

void receiver_close(receiver *r)
{
    if (r->others && r->others != r->images)
        lcm_destroy(r->others);
    if (r->images)
        lcm_destroy(r->images);
    *r = (receiver){0};
}

/* Handle waiting messages, all others before a frame; false when the connection has ended. */
static bool serve(receiver *r)
{
    int more = 0;
    while (r->others != r->images && (more = lcm_handle_timeout(r->others, 0)) > 0)
        ;
    return more >= 0 && lcm_handle_timeout(r->images, 0) >= 0;
}

/* By the monotonic clock, so that setting the date does not delay the status. */
static struct timespec until(int64_t deadline)
{
    int64_t const left = deadline - clock_monotonic();
    int64_t const us = left < 0 ? 0 : left > STATUS_US ? STATUS_US : left;
    return (struct timespec){.tv_sec = (time_t)(us / 1000000), .tv_nsec = (long)(us % 1000000) * 1000};
}

/* Whether any state has changed since its last status. */
static bool any_news(const receiver *r)
{
    const service *s = r->service;
    while (s && !s->news)
        s = s->next;
    return s;
}

bool receiver_run(receiver *r, const volatile sig_atomic_t *quit, const sigset_t *unblocked, message *why)
{
    int64_t due = 0, news = 0;
    struct pollfd fd[2] = {{.fd = lcm_get_fileno(r->images), .events = POLLIN},
                           {.fd = lcm_get_fileno(r->others), .events = POLLIN}};
    while (!*quit) {
        int64_t const now = clock_monotonic();
        snapshot_file_write(r->snapshot, r->service, false);
        bool const any = any_news(r);
        if (now >= due || (any && (r->log || now >= news))) {
            for (service *each = r->service; each; each = each->next)
                if (now >= due || each->news)
                    service_send_status(each);
            manager_report("WATCHDOG=1");
            due = now >= due || !r->service->next ? now + STATUS_US : due;
            news = now + NEWS_US;
        }
        struct timespec const wait = until(any_news(r) && news < due ? news : due);
        int const ready = ppoll(fd, r->log ? 1 : 2, &wait, unblocked);
        if (ready < 0 && errno != EINTR)
            return message_set(why, "cannot wait for messages: %s", strerror(errno));
        if (sink_ended(r->service->shared->out, why))
            return false;
        if (ready > 0 && !serve(r)) {
            flush_held(r);
            return r->log || message_set(why, "the LCM connection has failed");
        }
    }
    return true;
}
