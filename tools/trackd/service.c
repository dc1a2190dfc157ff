#include "service.h"

#include "gaitmsg_classes_t.h"
#include "gaitmsg_image_t.h"
#include "gaitmsg_stride_t.h"
#include "image_view.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void service_set_state(service *s, int8_t state, const char *text)
{
    s->state = state;
    s->news = true;
    if (s->cue && state != GAITMSG_STATUS_T_RUNNING)
        keypoint_cue_forget(s->cue);
    if (text)
        message_set(&s->text, "%s", text);
}

void service_complain(service *s, const char *format, ...)
{
    message line;
    va_list args;
    va_start(args, format);
    message_format(&line, format, args);
    va_end(args);
    s->news = true;
    if (strcmp(s->complaint.text, line.text) != 0 &&
        !(s->first && strcmp(s->first->complaint.text, line.text) == 0))
        log_event("%s", line.text);
    s->text = s->complaint = line;
}

/* Set the state while nothing is tracked: what the service waits for. */
static void set_idle(service *s)
{
    const service_shared *const c = s->shared;
    const further_camera *const unknown = c->slot.known && c->further ? further_unknown(c->further) : NULL;
    message camera;
    message_set(&camera, "waiting for a camera on GAIT_CAMERA_%d", unknown ? unknown->stream : c->stream);
    if (!s->track.tracker)
        service_set_state(s, GAITMSG_STATUS_T_WAITING, camera.text);
    else if (s->start.armed)
        service_set_state(s, GAITMSG_STATUS_T_ARMED, "waiting for the frame of the start");
    else
        service_set_state(s, GAITMSG_STATUS_T_READY,
                          !s->seek ? "waiting for START"
                          : s->track.background.data || s->cue
                              ? "waiting for a walking person, or for START"
                              : "waiting for the background to detect a person, or for START");
}

static void want_all(service *s)
{
    s->wanted = s->track.config.particles;
    gait_tracker_set_particles(s->track.tracker, s->wanted, NULL);
}

/* Return to the state at the start of the program. */
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
    gait_start_reset(s->track.start);
    if (s->has_init)
        start_trigger_by_file(&s->start, &s->init);
    set_idle(s);
}

/* Allocate memory for the particle cloud, once; acquisition may use more particles than tracking. */
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

bool service_open(service *s, const init_state *init, bool particles, message *why)
{
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

void service_shared_close(service_shared *c)
{
    frame_hold_close(&c->hold);
}

/* Whether the tracker accepts such a start, which takes effect at its frame.  Without a tracker, before a camera is known,
 * it is not checked. */
static bool start_usable(service *s, const gait_state *mean, const gait_state *sd)
{
    message why;
    if (!s->track.tracker || tracking_start(&s->track, mean, sd, 0, &why))
        return true;
    service_complain(s, "%s", why.text);
    return false;
}

/* Give the tracker the backgrounds of further cameras that arrived before it existed. */
static void set_further_backgrounds(service *s)
{
    const further *const f = s->shared->further;
    for (int i = 0; f && i < f->count; i++)
        if (f->camera[i].background.data)
            gait_tracker_set_background(s->track.tracker, 1 + i, &f->camera[i].background, NULL);
}

void service_share(service *s, service *first, int person, keypoint_cue *cue)
{
    service *last = first;
    while (last->next)
        last = last->next;
    last->next = s;
    tracking_share(&s->track, &first->track);
    s->first = first;
    s->person = person;
    s->shared = first->shared;
    s->budget = first->budget;
    s->cue = cue;
}

/* Make the tracker of one service for a camera. */
static bool set_camera(service *s, const gait_camera *camera, message *why)
{
    if (!tracking_set_camera(&s->track, camera, why))
        return false;
    want_all(s);
    bool const armed = s->start.armed;
    s->start.armed = armed && start_usable(s, &s->start.mean, &s->start.sd);
    if (s->start.armed == armed)
        set_idle(s);
    else
        service_set_state(s, GAITMSG_STATUS_T_READY, NULL);
    return true;
}

bool service_make_trackers(service *s, message *why)
{
    service_shared *const c = s->shared;
    const gait_camera *const camera = &c->slot.camera;
    if (c->further && further_unknown(c->further)) {
        set_idle(s);
        return true;
    }
    for (int i = 0; c->further && i < c->further->count; i++)
        s->track.config.camera[1 + i] = c->further->camera[i].slot.camera;
    s->track.config.cameras = 1 + (c->further ? c->further->count : 0);
    s->track.memory_bytes -= c->hold.capacity;
    frame_hold_close(&c->hold);
    bool made = set_camera(s, camera, why);
    size_t bytes = s->track.memory_bytes;
    int people = 1;
    message later; /* the first fault is reported */
    for (service *each = s->next; each; each = each->next, people++) {
        made = set_camera(each, camera, made ? why : &later) && made;
        bytes += each->track.memory_bytes;
    }
    if (!made || ((s->cue || c->path || c->further) && !frame_hold_allocate(&c->hold, camera, why)) ||
        (c->lift && !lift_service_camera(c->lift, camera, why)))
        return (c->slot.known = c->slot.fixed), false;
    s->track.memory_bytes += c->hold.capacity;
    set_further_backgrounds(s);
    const tracking *const t = &s->track;
    char trackers[32] = "tracker";
    if (people > 1)
        snprintf(trackers, sizeof trackers, "each of %d trackers", people);
    if (c->quiet)
        return true;
    log_event("model %016" PRIx64 ", camera %dx%d, %d particles, %d thread%s, %s, %zu bytes (model %zu, "
              "%s %zu, pool %zu, pictures %zu)",
              t->info.digest, camera->width, camera->height, t->config.particles, c->threads,
              c->threads == 1 ? "" : "s", gait_cpu_name(t->config.cpu_mask), bytes + c->hold.capacity,
              t->model_bytes, trackers, t->tracker_bytes, c->pool_bytes, t->picture_bytes);
    return true;
}

/* Whether two cameras differ at most in their poses. */
static bool same_lens(const gait_camera *a, const gait_camera *b)
{
    gait_camera there = *a;
    memcpy(there.R, b->R, sizeof there.R);
    memcpy(there.t, b->t, sizeof there.t);
    return camera_same(&there, b);
}

int64_t service_pixels_left(const service *s, const camera_slot *slot)
{
    const service_shared *const c = s->shared;
    int64_t left = c->max_pixels;
    if (slot != &c->slot && c->slot.known)
        left -= camera_pixels(&c->slot.camera);
    for (int i = 0; c->further && i < c->further->count; i++) {
        const camera_slot *const other = &c->further->camera[i].slot;
        left -= other != slot && other->known ? camera_pixels(&other->camera) : 0;
    }
    return left > 0 ? left : 0;
}

/* The poses of a camera; NULL: it stands still. */
static pose_path *path_of(const service *s, const further_camera *c)
{
    return c ? c->path : s->shared->path;
}

/* The camera of a message.  Its pose must be plausible, unless it is one of the poses of a moving camera. */
static bool take_camera(const service *s, const further_camera *c, const gaitmsg_camera_t *msg,
                        gait_camera *out, message *why)
{
    const camera_slot *const slot = c ? &c->slot : &s->shared->slot;
    char channel[24];
    snprintf(channel, sizeof channel, "GAIT_CAMERA_%d", c ? c->stream : s->shared->stream);
    return camera_from_message(msg, service_pixels_left(s, slot), out, why) &&
           ((path_of(s, c) && slot->known && same_lens(out, &slot->camera)) ||
            camera_plausible(out, channel, why));
}

/* The new camera is in its slot: begin anew with it. */
static bool begin_anew(service *s, further_camera *c, message *why)
{
    bool const followed = s->track.tracker != NULL;
    bool made = true;
    for (service *each = s; each; each = each->next)
        tracking_drop_camera(&each->track); /* its tracker borrows the background of a further camera */
    if (c) {
        s->track.memory_bytes -= c->bytes;
        made = further_allocate(c, why);
        s->track.memory_bytes += c->bytes;
    }
    made = made && (!s->shared->slot.known || service_make_trackers(s, why));
    for (service *each = s; followed && each; each = each->next)
        rearm(each);
    return made;
}

/* Why there is no camera; none if the text is empty.  A new reason is reported with the next frame. */
static void set_refused(service *s, const message *why)
{
    if (why->text[0] && strcmp(s->shared->refused.text, why->text) != 0)
        s->idle = SERVICE_IDLE_NOT;
    s->shared->refused = *why;
}

void service_camera(service *s, further_camera *c, const gaitmsg_camera_t *msg, int64_t arrival)
{
    camera_slot *const slot = c ? &c->slot : &s->shared->slot;
    pose_path *const path = path_of(s, c);
    gait_camera camera;
    message why, refused = {.text = ""};
    if (!take_camera(s, c, msg, &camera, &refused)) {
        service_complain(s, "%s", refused.text);
        slot->refused = clock_monotonic();
        if (!c)
            set_refused(s, &refused);
        return;
    }
    if (path && (!slot->known || same_lens(&camera, &slot->camera))) {
        if (!pose_path_add(path, msg->utime, &camera, &why))
            service_complain(s, "%s", why.text);
        camera = slot->known ? slot->camera : camera;
    }
    camera_answer const answer = camera_announced(slot, &camera, arrival);
    if (answer == CAMERA_REFUSED)
        slot->refused = clock_monotonic();
    if (answer == CAMERA_REFUSED && slot->fixed)
        service_complain(s, "a camera other than that of --camera was announced; it is ignored");
    else if (answer == CAMERA_REFUSED)
        service_complain(s,
                         "a different camera from the one in use was announced: it replaces that one after "
                         "10 seconds in which only it is announced%s",
                         !path && same_lens(&camera, &slot->camera)
                             ? "; if the camera moves, run with --moving-camera"
                             : "");
    else if (answer == CAMERA_NEW && !begin_anew(s, c, &refused))
        service_complain(s, "%s", refused.text);
    if (!c || refused.text[0])
        set_refused(s, &refused);
}

void service_further_background(service *s, further_camera *c, const image_view *v)
{
    message why;
    bool const known = c->background.data;
    if (!further_take_background(c, v, &why)) {
        s->counts.rejected++;
        service_complain(s, "%s", why.text);
    } else if (s->track.tracker)
        set_further_backgrounds(s);
    s->news = s->news || (!known && c->background.data);
}

bool service_pixels(service *s, const image_view *v, gait_image *out, message *why)
{
    const gait_camera *const c = &s->track.config.camera[0];
    tracking *const t = s->first ? &s->first->track : &s->track;
    if (v->pixelformat != GAITMSG_IMAGE_T_PIXEL_FORMAT_MJPEG)
        return image_view_pixels(v, c->width, c->height, out, why);
    if (!t->decoded.data &&
        !jpeg_decode(v->data, (size_t)v->size, c->width, c->height, t->pixels, &t->decoded, why))
        return false;
    *out = t->decoded;
    return true;
}

/* There is a background: state it, or what else is missing. */
static void take_background(service *s, bool is_first)
{
    if (is_first && s->state == GAITMSG_STATUS_T_READY)
        set_idle(s);
    else
        s->news = s->news || is_first;
}

void service_share_background(service *s)
{
    for (service *each = s->next; each; each = each->next) {
        bool const is_first = !each->track.background.data;
        tracking_share_background(&each->track);
        take_background(each, is_first);
    }
}

void service_background(service *s, const image_view *v)
{
    gait_image plate;
    message why;
    bool const is_first = !s->track.background.data;
    if (!s->track.tracker)
        return; /* it is sent again every few seconds */
    s->track.decoded.data = NULL;
    if (!service_pixels(s, v, &plate, &why) || !tracking_set_background(&s->track, &plate, &why)) {
        s->counts.rejected++;
        service_complain(s, "%s", why.text);
    } else {
        take_background(s, is_first);
        service_share_background(s);
    }
    s->shared->compared = false;
}

static void command_start(service *s, const gaitmsg_command_t *msg)
{
    const frame_hold *const hold = &s->shared->hold;
    char channel[LINK_CHANNEL];
    gait_state mean, sd;
    message why;
    if (!clock_check(msg->utime, &why) ||
        !convert_state_message(&msg->mean, &s->track.prior_mean, &mean, &why) ||
        !convert_state_message(&msg->sd, &s->track.prior_sd, &sd, &why)) {
        service_complain(s, "%s: %s", link_channel("GAIT_COMMAND", s->person, channel), why.text);
    } else if (start_usable(s, &mean, &sd)) {
        start_trigger_by_time(&s->start, &mean, &sd, msg->utime, hold->bytes ? hold->utime : -1);
        s->seek = !s->has_init;
        set_idle(s);
    }
}

void service_command(service *s, const gaitmsg_command_t *msg)
{
    if (msg->id != 0 && msg->id == s->command_id)
        return; /* repeated by a sender that has not yet seen its effect */
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
        service_complain(s, "unknown command %d; send START, STOP or RESET", msg->command);
    }
}

uint64_t service_digest(const service *s)
{
    return s->track.tracker ? gait_tracker_digest(s->track.tracker) : 0;
}

/* ---- messages out ---- */
enum { MESSAGE_BYTES = 1 << 16 }; /* more than an estimate or a status takes */
static uint8_t encoded[MESSAGE_BYTES];

static void send_particles(service *s, const image_view *v)
{
    int32_t const n =
        gait_tracker_particles(s->track.tracker, s->hypothesis, s->cloud.weight, s->hypotheses, NULL);
    s->cloud.utime = v->utime;
    s->cloud.frame = v->frame;
    s->cloud.n = n < 0 ? 0 : n;
    for (int32_t i = 0; i < s->cloud.n; i++)
        convert_state(&s->hypothesis[i], &s->track.info, &s->cloud.state[i]);
    sink_publish(s->shared->out, "GAIT_PARTICLES", s->person, s->particles,
                 gaitmsg_particles_t_encode(s->particles, 0, (int)s->particles_bytes, &s->cloud));
}

/* Set the counters of the message. */
static void set_counters(gaitmsg_estimate_t *m, const service *s, const past_frame *p)
{
    m->frame = p->frame;
    m->step = p->number;
    m->dropped = s->counts.dropped - s->dropped_before;
    m->receive_utime = p->receive_utime;
    m->step_us = p->step_us;
    m->tracker_digest = (int64_t)gait_tracker_digest(s->track.tracker);
}

/* The stride that ends with this estimate, if any. */
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
    sink_publish(s->shared->out, "GAIT_STRIDE", s->person, bytes,
                 gaitmsg_stride_t_encode(bytes, 0, sizeof bytes, &m));
}

/* Probabilities of the classes of motion, where the model has several: before the estimate, so that a receiver has
   both when the estimate arrives. */
static void send_classes(service *s, const char *channel, int64_t frame, const gait_estimate *e)
{
    uint8_t bytes[1024];
    float probability[GAIT_MAX_CLASSES];
    char *name[GAIT_MAX_CLASSES];
    int32_t const n = s->track.info.classes;
    if (n < 2)
        return;
    for (int32_t k = 0; k < n; k++)
        name[k] = (char *)gait_model_class_name(s->track.model, k); /* LCM's strings lack const; read only */
    memcpy(probability, e->class_probability, sizeof probability);
    gaitmsg_classes_t const m = {.utime = e->utime,
                                 .frame = frame,
                                 .most_probable = e->motion_class,
                                 .nclasses = n,
                                 .name = name,
                                 .probability = probability};
    sink_publish(s->shared->out, channel, s->person, bytes,
                 gaitmsg_classes_t_encode(bytes, 0, sizeof bytes, &m));
}

/* The estimate of the frame `lag` steps ago; steps that bridge a pause have no frame and are skipped. */
static void send_lagged(service *s)
{
    static estimate_message lagged;
    gait_estimate e;
    if (gait_tracker_lagged(s->track.tracker, s->track.config.lag, &e, NULL) != GAIT_OK)
        return;
    const past_frame *const p = &s->past[e.frame % SERVICE_PAST];
    if (p->step != e.frame)
        return;
    convert_estimate(s->track.model, &s->track.info, &e, &lagged);
    set_counters(&lagged.msg, s, p);
    send_classes(s, "GAIT_CLASSES_LAG", p->frame, &e);
    sink_publish(s->shared->out, "GAIT_ESTIMATE_LAG", s->person, encoded,
                 gaitmsg_estimate_t_encode(encoded, 0, MESSAGE_BYTES, &lagged.msg));
    send_stride(s, &e, p->frame);
}

void service_send_estimate(service *s, const image_view *v, const gait_estimate *e, int64_t received,
                           int64_t step_us)
{
    gaitmsg_estimate_t *const m = &s->estimate.msg;
    convert_estimate(s->track.model, &s->track.info, e, &s->estimate);
    past_frame *const now = &s->past[e->frame % SERVICE_PAST];
    *now = (past_frame){e->frame, v->frame, s->steps, received, (int32_t)step_us};
    set_counters(m, s, now);
    send_classes(s, "GAIT_CLASSES", v->frame, e);
    sink_publish(s->shared->out, "GAIT_ESTIMATE", s->person, encoded,
                 gaitmsg_estimate_t_encode(encoded, 0, MESSAGE_BYTES, m));
    if (s->track.config.lag > 0)
        send_lagged(s);
    else
        send_stride(s, e, v->frame);
    if (s->particles)
        send_particles(s, v);
}

#define ANOTHER_DAEMON "another gait-trackd uses this URL; stop it, or give each its own --url"

void service_status(service *s, int64_t utime)
{
    for (int i = 0; i < SERVICE_SENT; i++)
        if (s->sent[i] == utime)
            return;
    if (strcmp(s->complaint.text, ANOTHER_DAEMON) !=
        0) /* report it once: otherwise two daemons would answer each other without end */
        service_complain(s, ANOTHER_DAEMON);
    else
        s->text = s->complaint;
}

/* Bit i: the empty scene of camera i is known. */
static int32_t background_mask(const service *s)
{
    const further *const f = s->shared->further;
    int32_t mask = s->track.background.data ? 1 << s->shared->stream : 0;
    for (int i = 0; f && i < f->count; i++)
        mask |= f->camera[i].background.data ? 1 << f->camera[i].stream : 0;
    return mask;
}

/* Name the channel of a camera if another than the one in use has been announced there in the last seconds. */
static void name_refused(const camera_slot *slot, int stream, message *out)
{
    int64_t const lately = 3000000; /* they are announced every two seconds */
    size_t const n = strlen(out->text);
    if (slot->known && slot->refused && clock_monotonic() - slot->refused < lately)
        snprintf(out->text + n, sizeof out->text - n, " GAIT_CAMERA_%d", stream);
}

/* The text of the status. */
static void set_text(const service *s, message *out)
{
    const service_shared *const c = s->shared;
    const service *const first = s->first ? s->first : s;
    bool const starved =
        s->state == GAITMSG_STATUS_T_RUNNING && 1e-6 * (double)(clock_monotonic() - s->stepped) > c->max_gap;
    message channels = {.text = ""};
    name_refused(&c->slot, c->stream, &channels);
    for (int i = 0; c->further && i < c->further->count; i++)
        name_refused(&c->further->camera[i].slot, c->further->camera[i].stream, &channels);
    if (channels.text[0])
        message_set(out, "not the camera in use:%.70s; %.150s", channels.text, first->complaint.text);
    else
        message_set(out, "%s", starved ? "no frames arrive" : s->text.text);
}

void service_send_status(service *s)
{
    message text;
    char version[32];
    const histogram *const st = &s->counts.step, *const la = &s->counts.latency;
    uint32_t const v = gait_version();
    set_text(s, &text);
    snprintf(version, sizeof version, "%u.%u.%u", v / 10000, v / 100 % 100, v % 100);
    gaitmsg_status_t const msg = {
        .utime = clock_wall(),
        .version = version,
        .model_digest = (int64_t)s->track.info.digest,
        .tracker_digest = (int64_t)service_digest(s),
        .state = s->state,
        .background_mask = background_mask(s),
        .command_id = s->command_id,
        .frames = s->counts.frames,
        .dropped = s->counts.dropped,
        .rejected = s->counts.rejected,
        .particles = s->wanted ? s->wanted : s->track.config.particles,
        .threads = s->shared->threads,
        .step_us_median = histogram_quantile(st, 0.5),
        .step_us_p99 = histogram_quantile(st, 0.99),
        .step_us_max = st->largest,
        .latency_us_median = histogram_quantile(la, 0.5),
        .latency_us_p99 = histogram_quantile(la, 0.99),
        .latency_us_max = la->largest,
        .memory_bytes = (int64_t)s->track.memory_bytes,
        .text = text.text,
    };
    s->sent[s->statuses++ % SERVICE_SENT] = msg.utime;
    sink_publish(s->shared->out, "GAIT_STATUS", s->person, encoded,
                 gaitmsg_status_t_encode(encoded, 0, MESSAGE_BYTES, &msg));
    s->news = false;
}
