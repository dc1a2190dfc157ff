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

static void set_state(service *s, int8_t state, const char *text)
{
    s->state = state;
    s->news = true;
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

static void reject(service *s, const message *why)
{
    s->counts.rejected++;
    service_complain(s, why);
}

/* Not tracking: what is waited for? */
static void set_idle(service *s)
{
    if (!s->track.tracker)
        set_state(s, GAITMSG_STATUS_T_WAITING, "waiting for a camera");
    else if (s->start.armed)
        set_state(s, GAITMSG_STATUS_T_ARMED, "waiting for the frame of the start");
    else
        set_state(s, GAITMSG_STATUS_T_READY,
                  !s->seek ? "waiting for START"
                  : s->track.background.data
                      ? "looking for somebody who walks in, or waiting for START"
                      : "waiting for the empty scene to look for somebody, or for START");
}

/* As after the program's start. */
static void rearm(service *s)
{
    memset(&s->counts, 0, sizeof s->counts);
    s->budget.late = s->budget.over = s->budget.slow_steps = 0;
    s->dropped_before = 0;
    s->last_frame = s->last_utime = -1;
    s->start = (arming){0};
    s->complaint.text[0] = '\0';
    s->seek = !s->has_init;
    spotter_forget(&s->spotter);
    if (s->has_init)
        arming_by_file(&s->start, &s->init);
    set_idle(s);
}

/* Memory for the particle cloud: taken once, as large as it can become. */
static bool open_particles(service *s, message *why)
{
    size_t const n = (size_t)s->track.config.particles;
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

bool service_open(service *s, lcm_t *out, int stream, int threads, const init_state *init, bool particles,
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

bool service_set_camera(service *s, const gait_camera *camera, message *why)
{
    if (!tracking_set_camera(&s->track, camera, why) || (s->cue && !tracks_cue_room(s->cue, camera, why)))
        return false;
    s->track.memory_bytes += s->cue ? s->cue->room : 0;
    const tracking *const t = &s->track;
    fprintf(stderr,
            "gait-trackd: model %016" PRIx64
            ", camera %dx%d, %d particles, %d thread%s, %s, %zu bytes (model %zu, "
            "tracker %zu, pool %zu, pictures %zu)\n",
            t->info.digest, camera->width, camera->height, t->config.particles, s->threads,
            s->threads == 1 ? "" : "s", gait_cpu_name(t->config.cpu_mask), t->memory_bytes, t->model_bytes,
            t->tracker_bytes, s->pool_bytes, t->picture_bytes);
    s->wanted = s->track.config.particles;
    set_idle(s);
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
    if (memcmp(&camera, &s->track.config.camera[0], sizeof camera) != 0) {
        message_set(&why, "another camera than the one in use was announced and is ignored; restart for it");
        service_complain(s, &why);
    }
}

/* Pixels of a frame or plate as the tracker takes them. */
static bool pixels_of(service *s, const image_view *v, gait_image *out, message *why)
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
    if (!pixels_of(s, v, &plate, &why) || !tracking_set_background(&s->track, &plate, &why))
        reject(s, &why);
    else if (first && s->state == GAITMSG_STATUS_T_READY)
        set_idle(s);
    else
        s->news = s->news || first;
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
    arming_by_time(&s->start, &mean, &sd, msg->utime);
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

/* Frames that never arrived, by the gap in their numbers. */
static void count_gap(service *s, const image_view *v)
{
    if (s->state == GAITMSG_STATUS_T_RUNNING && s->last_frame >= 0 && v->frame > s->last_frame + 1)
        s->counts.dropped += v->frame - s->last_frame - 1;
    s->last_frame = v->frame > s->last_frame ? v->frame : s->last_frame;
}

/* Begin to track if the armed start has come; true when the tracker runs. */
static bool begin(service *s, const image_view *v)
{
    message why;
    gait_error err = {.text = ""};
    int64_t utime;
    arming_answer const answer = arming_reached(&s->start, v, s->max_gap, &utime, &why);
    if (answer == ARMING_WAIT)
        return false;
    gait_status const status = answer == ARMING_MISSED ? GAIT_ERR_STATE
                                                       : gait_tracker_start(s->track.tracker, &s->start.mean,
                                                                            &s->start.sd, utime, &err);
    if (answer != ARMING_MISSED && status != GAIT_OK)
        message_set(&why, "cannot start: %s (%s)", err.text, gait_status_name(status));
    if (status != GAIT_OK) {
        set_state(s, GAITMSG_STATUS_T_READY, NULL);
        service_complain(s, &why);
        return false;
    }
    s->last_utime = utime;
    s->dropped_before = s->counts.dropped;
    s->last_frame = v->frame;
    s->steps = 0;
    memset(s->past, 0xff, sizeof s->past); /* no step has such a number */
    s->meter.running = false;
    set_state(s, GAITMSG_STATUS_T_RUNNING, "tracking");
    return true;
}

static void stop(service *s, const message *why)
{
    set_state(s, GAITMSG_STATUS_T_READY, NULL);
    service_complain(s, why);
}

/* Can this frame follow the last one?  A pause that is too long stops the tracker, or it would wait for
 * ever. */
static bool in_time(service *s, const image_view *v)
{
    message why;
    int64_t const gap = v->utime - s->last_utime;
    double const pause = (double)gap * 1e-6;
    if (pause > s->max_gap) {
        message_set(&why, "no frame for %.3f s (at most %.3f): stopped; send START", pause, s->max_gap);
        stop(s, &why);
        return false;
    }
    if (gap < 0 || (gap == 0 && s->steps > 0)) {
        message_set(&why, "capture time did not advance (%.6f s); stamp frames in order", pause);
        reject(s, &why);
        return false;
    }
    return true;
}

/* Look for somebody to start with; true when the tracker has begun with this frame. */
static bool spot(service *s, const image_view *v, const gait_image *frame)
{
    gait_state mean = s->track.prior_mean, sd = s->track.prior_sd;
    if (!s->seek || !s->track.background.data ||
        !spotter_see(&s->spotter, frame, &s->track.background, &s->track.config.camera[0], s->track.model,
                     v->utime, &mean, &sd))
        return false;
    spotter_forget(&s->spotter);
    arming_by_time(&s->start, &mean, &sd, v->utime);
    return begin(s, v);
}

/* Nobody is tracked: start with whoever walks in. */
static bool spot_first(service *s, const image_view *v)
{
    gait_image frame;
    message why;
    return s->seek && pixels_of(s, v, &frame, &why) && spot(s, v, &frame);
}

/* Predict through a pause longer than one step may be, in equal steps without an image. */
static gait_status bridge(service *s, int64_t utime, gait_estimate *out, gait_error *err)
{
    int64_t const longest = (int64_t)((double)s->track.config.max_dt * 1e6), from = s->last_utime;
    int64_t const pieces = (utime - from + longest - 1) / longest;
    for (int64_t i = 1; i < pieces; i++) {
        gait_frame const nothing = {.utime = from + (utime - from) * i / pieces};
        gait_status const status = gait_tracker_step(s->track.tracker, &nothing, out, err);
        if (status != GAIT_OK)
            return status;
    }
    return GAIT_OK;
}

/* Go on with another number of particles if the budget says so. */
static void adapt(service *s, int64_t birth, int64_t step_us)
{
    int32_t const had = s->wanted;
    s->wanted = budget_stepped(&s->budget, birth, service_now(), step_us, had);
    if (budget_hopeless(&s->budget, s->wanted))
        fprintf(stderr,
                "gait-trackd: a step takes %.1f ms, more than the budget of %.1f: fewer --particles, more "
                "--threads or --adapt-particles\n",
                (double)s->budget.step_us / 1e3, (double)s->budget.limit_us / 1e3);
    if (s->wanted == had || gait_tracker_set_particles(s->track.tracker, s->wanted, NULL) != GAIT_OK)
        return;
    fprintf(stderr, "gait-trackd: %d particles instead of %d: a step took %.1f ms of %.1f\n", (int)s->wanted,
            (int)had, (double)s->budget.step_us / 1e3, (double)s->budget.limit_us / 1e3);
    s->news = true;
}

/* Track the frame; false: it could not be used. */
static bool step(service *s, const image_view *v, int64_t received, int64_t birth)
{
    gait_frame frame = {.utime = v->utime};
    gait_estimate estimate;
    gait_error err = {.text = ""};
    message why;
    int64_t const begun = clock_us(CLOCK_MONOTONIC);
    if (!pixels_of(s, v, &frame.image[0], &why)) {
        reject(s, &why);
        return false;
    }
    if (s->cue)
        frame.tracks[0] = tracks_cue_use(s->cue, v->utime);
    gait_status status = bridge(s, v->utime, &estimate, &err);
    if (status == GAIT_OK)
        status = gait_tracker_step(s->track.tracker, &frame, &estimate, &err);
    if (status != GAIT_OK) {
        message_set(&why, "stopped: %s (%s); send START", err.text, gait_status_name(status));
        stop(s, &why);
        return false;
    }
    int64_t const step_us = clock_us(CLOCK_MONOTONIC) - begun;
    s->last_utime = v->utime;
    s->counts.frames++;
    message_set(&s->text, "tracking");
    histogram_add(&s->counts.step, step_us);
    service_send_estimate(s, v, &estimate, received, step_us);
    s->steps++;
    histogram_add(&s->counts.latency, service_now() - v->utime);
    adapt(s, birth, step_us);
    if (estimate.status == GAIT_STATUS_LOST)
        spot(s, v, &frame.image[0]);
    else if (estimate.status != GAIT_STATUS_INIT)
        spotter_forget(&s->spotter);
    return true;
}

/* May this frame be tracked, or is there a newer one, or is it too old? */
static bool fresh(service *s, bool newest, int64_t birth, int64_t now)
{
    message why;
    if (!newest)
        budget_missed(&s->budget);
    else if (budget_allows(&s->budget, birth, now))
        return true;
    else {
        message_set(&why, "frames too old for a budget of %.1f ms are dropped",
                    (double)s->budget.limit_us / 1e3);
        service_complain(s, &why);
    }
    return false;
}

void service_frame(service *s, const image_view *v, bool newest, int64_t arrival_utime)
{
    int64_t const now = service_now(), birth = budget_birth(v->utime, arrival_utime);
    count_gap(s, v);
    if (s->state == GAITMSG_STATUS_T_ARMED && !begin(s, v))
        return;
    if (s->state == GAITMSG_STATUS_T_READY && newest && !spot_first(s, v))
        return;
    if (s->state != GAITMSG_STATUS_T_RUNNING)
        return;
    if (!fresh(s, newest, birth, now) || !in_time(s, v) || !step(s, v, now, birth))
        s->counts.dropped++;
}

uint64_t service_digest(const service *s)
{
    return s->track.tracker ? gait_tracker_digest(s->track.tracker) : 0;
}
