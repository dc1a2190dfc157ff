#include "service.h"

#include "gaitmsg_image_t.h"
#include "jpeg.h"
#include "service_send.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static int64_t clock_us(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

int64_t service_now(void)
{
    return clock_us(CLOCK_REALTIME);
}

int64_t service_ticks(void)
{
    return clock_us(CLOCK_MONOTONIC);
}

void service_set_state(service *s, int8_t state, const char *text)
{
    s->state = state;
    s->news = true;
    if (s->cue && state != GAITMSG_STATUS_T_RUNNING)
        keypoint_cue_forget(s->cue);
    if (text)
        message_set(&s->text, "%s", text);
}

void service_complain(service *s, const message *why)
{
    s->news = true;
    if (strcmp(s->complaint.text, why->text) != 0)
        fprintf(stderr, "gait-trackd: %s\n", why->text);
    s->text = s->complaint = *why;
}

void service_reject(service *s, const message *why)
{
    s->counts.rejected++;
    service_complain(s, why);
}

/* Not tracking: what is waited for? */
static void set_idle(service *s)
{
    if (!s->track.tracker)
        service_set_state(s, GAITMSG_STATUS_T_WAITING, "waiting for a camera");
    else if (s->start.armed)
        service_set_state(s, GAITMSG_STATUS_T_ARMED, "waiting for the frame of the start");
    else
        service_set_state(s, GAITMSG_STATUS_T_READY,
                          !s->seek ? "waiting for START"
                          : s->track.background.data
                              ? "looking for somebody who walks in, or waiting for START"
                              : "waiting for the empty scene to look for somebody, or for START");
}

/* As many particles as were asked for. */
static void want_all(service *s)
{
    s->wanted = s->track.config.particles;
    gait_tracker_set_particles(s->track.tracker, s->wanted, NULL);
}

/* As after the program's start. */
static void rearm(service *s)
{
    memset(&s->counts, 0, sizeof s->counts);
    budget_reset(&s->budget);
    if (s->track.tracker)
        want_all(s);
    s->dropped_before = 0;
    s->last_frame = s->last_utime = -1;
    s->start = (start_trigger){0};
    s->complaint.text[0] = '\0';
    s->idle = SERVICE_IDLE_NOT;
    s->seek = !s->has_init;
    auto_start_reset(&s->auto_start);
    if (s->has_init)
        start_trigger_by_file(&s->start, &s->init);
    set_idle(s);
}

/* Memory for the particle cloud: taken once, as large as it can become; a search may take more particles. */
static bool open_particles(service *s, message *why)
{
    const gait_tracker_config *const c = &s->track.config;
    s->hypotheses = c->acquisition_particles > c->particles ? c->acquisition_particles : c->particles;
    size_t const n = (size_t)s->hypotheses;
    s->particles_bytes = 64 + n * (sizeof(float) + sizeof(gaitmsg_state_t));
    s->particles = malloc(s->particles_bytes);
    s->hypothesis = malloc(n * sizeof *s->hypothesis);
    s->cloud.weight = malloc(n * sizeof *s->cloud.weight);
    s->cloud.state = malloc(n * sizeof *s->cloud.state);
    s->track.memory_bytes +=
        s->particles_bytes + n * (sizeof *s->hypothesis + sizeof(float) + sizeof(gaitmsg_state_t));
    return (s->particles && s->hypothesis && s->cloud.weight && s->cloud.state) ||
           message_set(why, "not enough memory for --particles-channel with %zu particles", n);
}

bool service_open(service *s, sink *out, int stream, int threads, const init_state *init, bool particles,
                  message *why)
{
    s->out = out;
    s->stream = stream;
    s->threads = threads;
    s->has_init = init != NULL;
    if (init)
        s->init = *init;
    rearm(s);
    return !particles || open_particles(s, why);
}

void service_close(service *s)
{
    free(s->particles);
    free(s->hypothesis);
    free(s->cloud.weight);
    free(s->cloud.state);
    tracking_close(&s->track);
}

/* Would the tracker take such a start?  It is begun anew when its frame comes; before there is a tracker nobody knows,
 * and it is asked as soon as the camera is known. */
static bool start_usable(service *s, const gait_state *mean, const gait_state *sd)
{
    message why;
    if (!s->track.tracker || tracking_start(&s->track, mean, sd, 0, &why))
        return true;
    service_complain(s, &why);
    return false;
}

bool service_set_camera(service *s, const gait_camera *camera, message *why)
{
    if (!tracking_set_camera(&s->track, camera, why) || (s->cue && !keypoint_cue_room(s->cue, camera, why)))
        return false;
    s->track.memory_bytes += s->cue ? s->cue->room : 0;
    const tracking *const t = &s->track;
    bool const armed = s->start.armed;
    fprintf(stderr,
            "gait-trackd: model %016" PRIx64
            ", camera %dx%d, %d particles, %d thread%s, %s, %zu bytes (model %zu, "
            "tracker %zu, pool %zu, pictures %zu)\n",
            t->info.digest, camera->width, camera->height, t->config.particles, s->threads,
            s->threads == 1 ? "" : "s", gait_cpu_name(t->config.cpu_mask), t->memory_bytes, t->model_bytes,
            t->tracker_bytes, s->pool_bytes, t->picture_bytes);
    want_all(s);
    s->start.armed = s->start.armed && start_usable(s, &s->start.mean, &s->start.sd);
    if (s->start.armed == armed)
        set_idle(s);
    else
        service_set_state(s, GAITMSG_STATUS_T_READY, NULL);
    return true;
}

void service_camera(service *s, const gaitmsg_camera_t *msg)
{
    gait_camera camera;
    message why;
    if (!convert_camera_message(msg, &camera, &why) ||
        (!s->track.tracker && !service_set_camera(s, &camera, &why))) {
        service_complain(s, &why);
        return;
    }
    if (!convert_same_camera(&camera, &s->track.config.camera[0])) {
        message_set(&why, "another camera than the one in use was announced and is ignored; restart for it");
        service_complain(s, &why);
    }
}

bool service_pixels(service *s, const image_view *v, gait_image *out, message *why)
{
    const gait_camera *const c = &s->track.config.camera[0];
    if (v->pixelformat == GAITMSG_IMAGE_T_PIXEL_FORMAT_MJPEG)
        return jpeg_decode(v->data, (size_t)v->size, c->width, c->height, s->track.pixels, out, why);
    return image_view_pixels(v, c->width, c->height, out, why);
}

void service_background(service *s, const image_view *v)
{
    gait_image plate;
    message why;
    bool const first = !s->track.background.data;
    if (!s->track.tracker)
        return; /* it is sent again every few seconds */
    if (!service_pixels(s, v, &plate, &why) || !tracking_set_background(&s->track, &plate, &why))
        service_reject(s, &why);
    else if (first && s->state == GAITMSG_STATUS_T_READY)
        set_idle(s);
    else
        s->news = s->news || first;
    s->compared = false;
}

static void command_start(service *s, const gaitmsg_command_t *msg)
{
    gait_state mean, sd;
    message why;
    if (!convert_state_message(&msg->mean, &s->track.prior_mean, &mean, &why) ||
        !convert_state_message(&msg->sd, &s->track.prior_sd, &sd, &why)) {
        service_complain(s, &why);
        return;
    }
    if (!start_usable(s, &mean, &sd))
        return;
    start_trigger_by_time(&s->start, &mean, &sd, msg->utime);
    s->seek = !s->has_init;
    set_idle(s);
}

void service_command(service *s, const gaitmsg_command_t *msg)
{
    message why;
    if (msg->id != 0 && msg->id == s->command_id)
        return; /* sent again because its effect was not seen yet */
    s->command_id = msg->id;
    s->news = true;
    if (msg->command == GAITMSG_COMMAND_T_START) {
        command_start(s, msg);
    } else if (msg->command == GAITMSG_COMMAND_T_STOP) {
        s->start.armed = s->seek = false;
        set_idle(s);
    } else if (msg->command == GAITMSG_COMMAND_T_RESET) {
        rearm(s);
    } else {
        message_set(&why, "unknown command %d; send START, STOP or RESET", msg->command);
        service_complain(s, &why);
    }
}

uint64_t service_digest(const service *s)
{
    return s->track.tracker ? gait_tracker_digest(s->track.tracker) : 0;
}
