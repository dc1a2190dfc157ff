/* service_frame.c - what the service does with a frame: start, step the tracker, look for a person. */
#include "service.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    FIT_PERIOD = 100000, /* microseconds between two fits of the automatic start */
    /* microseconds of frames without keypoints after which one of several people who is lost has left */
    AWAY = 1000000,
    LONGEST_GAP = 1 << 20 /* frames; a number that is further away begins a new count */
};

/* Count the frames that did not arrive, by the gap in their numbers. */
static void count_gap(service *s, const image_view *v)
{
    if (v->frame < 0)
        return;
    bool const follows = s->last_frame >= 0 && v->frame - s->last_frame < LONGEST_GAP &&
                         s->last_frame - v->frame < LONGEST_GAP;
    if (follows && s->state == GAITMSG_STATUS_T_RUNNING && v->frame > s->last_frame + 1)
        s->counts.dropped += v->frame - s->last_frame - 1;
    s->last_frame = follows && v->frame < s->last_frame ? s->last_frame : v->frame;
}

/* Whether this frame has arrived before, or has been counted as one that did not arrive. */
static bool is_repeated(const service *s, const image_view *v)
{
    bool const numbered = v->frame >= 0 && s->last_frame >= 0;
    return v->utime == s->last_arrived ||
           (numbered &&
            (v->frame == s->last_frame || (v->frame < s->last_frame && v->utime < s->last_arrived)));
}

/* Stop tracking; the reason is reported by the caller. */
static void stop(service *s)
{
    service_set_state(s, GAITMSG_STATUS_T_READY, NULL);
    if (!s->seek)
        s->idle = SERVICE_IDLE_START;
}

/* The tracker has started at a capture time. */
static void run(service *s, const image_view *v, int64_t utime)
{
    s->last_utime = utime;
    s->stepped = clock_monotonic();
    s->dropped_before = s->counts.dropped;
    s->last_frame = v->frame;
    s->last_arrived = v->utime;
    s->missed = false;
    s->steps = 0;
    s->last_status = GAIT_TRACK_INIT;
    memset(s->past, 0xff, sizeof s->past); /* a number that no step has */
    s->meter.running = false;
    service_set_state(s, GAITMSG_STATUS_T_RUNNING, "tracking");
}

void service_resume(service *s, int64_t utime, int64_t frame, int64_t steps)
{
    image_view const last = {.utime = utime, .frame = frame};
    gait_estimate e;
    run(s, &last, utime);
    s->steps = steps;
    if (gait_tracker_lagged(s->track.tracker, 0, &e, NULL) == GAIT_OK) {
        s->last = e.mean;
        s->last_status = e.status;
    }
    if (s->cue)
        keypoint_cue_resume(s->cue, utime);
}

/* Begin to track if the frame of the start has arrived; true when the tracker runs. */
static bool begin(service *s, const image_view *v)
{
    message why;
    int64_t utime;
    start_trigger_answer const answer = start_trigger_reached(&s->start, v, s->shared->max_gap, &utime, &why);
    if (answer == START_TRIGGER_WAIT)
        return false;
    if (answer == START_TRIGGER_MISSED ||
        !tracking_start(&s->track, &s->start.mean, &s->start.sd, utime, &why)) {
        stop(s);
        service_complain(s, "%s", why.text);
        return false;
    }
    run(s, v, utime);
    return true;
}

/* The person is out of view: wait for their keypoints. */
static void leave(service *s)
{
    stop(s);
    message_set(&s->text, "person %d is out of view", s->person);
    log_event("%s", s->text.text);
}

/* What happens after tracking has stopped. */
static const char *next_start(const service *s)
{
    return s->seek ? "searching for a person again" : "send START";
}

/* Whether this frame can follow the last one.  Too long a pause stops the tracker, and so does a clock that was set back by
 * as much, because otherwise the tracker would wait until it has caught up. */
static bool in_time(service *s, const image_view *v)
{
    double const pause = 1e-6 * ((double)v->utime - (double)s->last_utime); /* cannot overflow */
    if (fabs(pause) > s->shared->max_gap) {
        stop(s);
        service_complain(s,
                         pause > 0 ? "no frame for %.3f s (at most %.3f): stopped; %s"
                                   : "capture time went back by %.3f s (at most %.3f): stopped; %s",
                         fabs(pause), s->shared->max_gap, next_start(s));
        return false;
    }
    if (pause > 0 || (pause == 0 && s->steps == 0))
        return true;
    s->counts.rejected++;
    service_complain(s, "capture time did not advance; stamp frames in order");
    return false;
}

/* Report once if the background shows another scene than the frame. */
static void compare_scene(service *s, const gait_image *frame)
{
    int32_t other = 0;
    if (s->shared->compared || s->shared->path || s->first || !s->track.background.data)
        return;
    s->shared->compared = true;
    (void)gait_start_other_scene(s->track.start, frame, &s->track.background, &other, NULL);
    if (other)
        service_complain(
            s,
            "half of the image differs from the background: give that of this camera (--background, "
            "GAIT_BACKGROUND_%d)",
            s->shared->stream);
}

/* Give the automatic start the keypoints of a frame and the regions that differ from the background; false: there are
 * neither, or the clock was set back. */
static bool observe(service *s, int64_t utime, const gait_image *frame)
{
    gait_start *const start = s->track.start;
    const pose_path *const path = s->shared->path;
    const gait_keypoint *const found = s->cue ? keypoint_cue_at(s->cue, utime) : NULL;
    bool const scene = s->track.background.data != NULL && !path && !s->person;
    bool fine = true;
    gait_camera_pose pose;
    message why;
    if (path && (pose_path_at(path, utime, &pose, &why) != POSE_KNOWN ||
                 gait_start_set_pose(start, &pose, NULL) != GAIT_OK))
        return false;
    if (found)
        fine = gait_start_add(start, utime, found, NULL) == GAIT_OK;
    if (scene) {
        gait_box boxes[GAIT_START_MAX_PEOPLE];
        int32_t count = 0;
        (void)gait_start_find_boxes(start, frame, &s->track.background, boxes, GAIT_START_MAX_PEOPLE, &count,
                                    NULL);
        fine = gait_start_add_boxes(start, utime, boxes, count, NULL) == GAIT_OK && fine;
    }
    if (!fine)
        gait_start_reset(start);
    return fine && (found || scene);
}

/* Look for a person to start with; true when the tracker has started with this frame. */
static bool try_auto_start(service *s, const image_view *v, const gait_image *frame)
{
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    int32_t count = 0;
    if (!s->seek || !observe(s, v->utime, frame))
        return false;
    if (v->utime >= s->fitted && v->utime < s->fitted + FIT_PERIOD)
        return false;
    s->fitted = v->utime;
    if (gait_start_solve(s->track.start, v->utime, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) != GAIT_OK ||
        !gait_hypothesis_walks(h) || (h->in_place && s->track.config.belt == 0.0) ||
        gait_tracker_start_hypotheses(s->track.tracker, h, count, v->utime, NULL) != GAIT_OK)
        return false;
    gait_start_reset(s->track.start);
    run(s, v, v->utime);
    char number[12] = "";
    if (s->person)
        snprintf(number, sizeof number, " %d", s->person);
    log_event("person%s found at frame %" PRId64 ": x %.2f y %.2f m, heading %.0f degrees", number, v->frame,
              (double)h->mean.pelvis[0], (double)h->mean.pelvis[1], (double)h->mean.heading * 57.29578);
    return true;
}

/* While no person is tracked: start with one who walks. */
static bool start_with_first(service *s, const image_view *v)
{
    gait_image frame;
    message why;
    if (!s->seek || !service_pixels(s, v, &frame, &why))
        return false;
    compare_scene(s, &frame);
    return try_auto_start(s, v, &frame);
}

/* Predict through a pause longer than one step may be, in equal steps without an image. */
static gait_result bridge(service *s, int64_t utime, gait_estimate *out, gait_error *err)
{
    int64_t const longest = (int64_t)((double)s->track.config.max_dt * 1e6), from = s->last_utime;
    int64_t const pieces = (utime - from + longest - 1) / longest;
    for (int64_t i = 1; i < pieces; i++) {
        gait_frame const nothing = {.utime = from + (utime - from) * i / pieces};
        gait_result const status = gait_tracker_step(s->track.tracker, &nothing, out, err);
        if (status != GAIT_OK)
            return status;
    }
    return GAIT_OK;
}

static void log_particles(const service *s, int32_t had)
{
    const budget *const b = &s->budget;
    if (b->reason == BUDGET_DROPPED)
        log_event("%d particles instead of %d: %d frames were dropped", (int)s->wanted, (int)had,
                  (int)b->lost);
    else
        log_event("%d particles instead of %d: a step %s %.1f ms of %.1f", (int)s->wanted, (int)had,
                  b->reason == BUDGET_SPARE ? "takes only" : "took", (double)b->took_us / 1e3,
                  (double)b->limit_us / 1e3);
}

/* Change the number of particles if the budget requires it. */
static void adapt(service *s, int64_t birth, int64_t step_us)
{
    int32_t const had = s->wanted;
    s->wanted = budget_stepped(&s->budget, birth, clock_wall(), step_us, had);
    if (budget_hopeless(&s->budget, s->wanted))
        log_event(
            "a step takes %.1f ms, more than the budget of %.1f: use fewer --particles, more --threads or "
            "--adapt-particles",
            (double)s->budget.step_us / 1e3, (double)s->budget.limit_us / 1e3);
    if (s->wanted == had || gait_tracker_set_particles(s->track.tracker, s->wanted, NULL) != GAIT_OK)
        return;
    log_particles(s, had);
    s->news = true;
}

/* Track the frame; false if it cannot be used. */
static bool step(service *s, const image_view *v, int64_t received, int64_t birth)
{
    gait_frame frame = {.utime = v->utime};
    gait_estimate estimate;
    gait_error err = {.text = ""};
    gait_camera_pose pose;
    message why;
    int64_t const begun = clock_monotonic();
    if (!service_pixels(s, v, &frame.image[0], &why)) {
        s->counts.rejected++;
        service_complain(s, "%s", why.text);
        return false;
    }
    compare_scene(s, &frame.image[0]);
    if (s->shared->further && !s->first && !further_images(s->shared->further, v->utime, &frame, &why))
        service_complain(s, "%s", why.text);
    if (s->cue)
        frame.keypoints[0] = keypoint_cue_use(s->cue, v->utime);
    if (s->shared->path && pose_path_now(s->shared->path, v->utime, &pose, &why))
        frame.pose[0] = &pose;
    else if (s->shared->path) {
        frame.image[0].data = NULL; /* the camera's pose is unknown: only predict */
        service_complain(s, "%s", why.text);
    }
    if (s->shared->nearest_utime == v->utime) {
        const service *const first = s->first ? s->first : s;
        const gait_camera *const c = &s->track.config.camera[0];
        frame.people[0] = (gait_image){first->track.nearest, c->width, c->height, c->width, GAIT_GREY8};
        frame.person = (uint64_t)s->person;
    }
    gait_result status = bridge(s, v->utime, &estimate, &err);
    if (status == GAIT_OK)
        status = gait_tracker_step(s->track.tracker, &frame, &estimate, &err);
    if (status != GAIT_OK) {
        stop(s);
        service_complain(s, "stopped: %s (%s); %s", err.text, gait_result_name(status), next_start(s));
        return false;
    }
    int64_t const step_us = clock_monotonic() - begun;
    s->last_utime = v->utime;
    s->stepped = clock_monotonic();
    s->last = estimate.mean;
    s->last_status = estimate.status;
    s->counts.frames++;
    s->tracked++;
    message_set(&s->text, "tracking");
    histogram_add(&s->counts.step, step_us);
    service_send_estimate(s, v, &estimate, received, step_us);
    s->steps++;
    histogram_add(&s->counts.latency, clock_wall() - v->utime);
    adapt(s, birth, step_us);
    if (s->person && estimate.status == GAIT_TRACK_LOST && s->cue->unseen > AWAY)
        leave(s); /* images alone would find another person */
    else if (estimate.status == GAIT_TRACK_LOST && frame.image[0].data)
        try_auto_start(s, v, &frame.image[0]);
    else if (estimate.status != GAIT_TRACK_INIT)
        gait_start_reset(s->track.start);
    return true;
}

/* Whether this frame may be tracked: it is the newest and not too old. */
static bool fresh(service *s, bool newest, int64_t birth, int64_t now)
{
    if (!newest)
        budget_missed(&s->budget);
    else if (budget_allows(&s->budget, birth, now))
        return true;
    else
        service_complain(s, "frames too old for a budget of %.1f ms are dropped",
                         (double)s->budget.limit_us / 1e3);
    return false;
}

/* Why incoming frames are not tracked, SERVICE_IDLE_*. */
static int idle_of(const service *s)
{
    if (s->state == GAITMSG_STATUS_T_WAITING)
        return SERVICE_IDLE_CAMERA;
    if (s->state != GAITMSG_STATUS_T_READY)
        return SERVICE_IDLE_NOT;
    if (!s->seek)
        return SERVICE_IDLE_START;
    return (s->track.background.data && !s->shared->path && !s->person) || s->cue ? SERVICE_IDLE_SEARCHING
                                                                                  : SERVICE_IDLE_SCENE;
}

/* State what is missing. */
static void set_lack(const service *s, int idle, message *why)
{
    const service_shared *const c = s->shared;
    int const i = c->stream;
    const further_camera *const unknown = c->slot.known && c->further ? further_unknown(c->further) : NULL;
    if (idle == SERVICE_IDLE_CAMERA && unknown)
        message_set(why, "no camera: announce it on GAIT_CAMERA_%d", unknown->stream);
    else if (idle == SERVICE_IDLE_CAMERA && c->refused.text[0])
        message_set(why, "no usable camera: %.200s", c->refused.text);
    else if (idle == SERVICE_IDLE_CAMERA)
        message_set(why, "no camera: give --camera or announce it on GAIT_CAMERA_%d", i);
    else if (idle == SERVICE_IDLE_START)
        message_set(why, "no START: send it on GAIT_COMMAND, or run with --init");
    else if (idle == SERVICE_IDLE_SCENE && c->path)
        message_set(why, "--init auto needs keypoints to find a person with a moving camera: run with "
                         "--keypoints-term, or send START on GAIT_COMMAND");
    else if (idle == SERVICE_IDLE_SCENE)
        message_set(why,
                    "--init auto needs the background to detect a person: give --background, send "
                    "GAIT_BACKGROUND_%d, or send START on GAIT_COMMAND",
                    i);
    else if (idle == SERVICE_IDLE_SEARCHING)
        message_set(why, "no person walks in full view for a second");
    else
        message_set(why, "the frame of the start did not arrive");
}

/* Report why frames are not tracked, again when the reason changes. */
static void log_idle(service *s)
{
    message why;
    int const idle = idle_of(s);
    if (idle == s->idle || s->first)
        return;
    s->idle = idle;
    set_lack(s, idle, &why);
    if (idle == SERVICE_IDLE_SEARCHING)
        log_event("searching for a person who walks in full view");
    else if (idle != SERVICE_IDLE_NOT)
        log_event("frames arrive, but %s", why.text);
}

void service_lack(const service *s, message *why)
{
    if (s->state != GAITMSG_STATUS_T_WAITING && s->complaint.text[0])
        *why = s->complaint;
    else
        set_lack(s, idle_of(s), why);
}

bool service_waits(const service *s, int64_t utime)
{
    const service_shared *const c = s->shared;
    gait_camera_pose pose;
    message why;
    for (const service *each = s; each; each = each->next)
        if (each->cue && !keypoint_cue_arrived(each->cue, utime))
            return true;
    return (c->path && pose_path_at(c->path, utime, &pose, &why) == POSE_LATER) ||
           (c->further && further_waits(c->further, utime));
}

/* Draw who is nearest in a frame, if at least two people are followed. */
static void draw_nearest(service *s, int64_t utime)
{
    nearest_body body[PEOPLE_MOST];
    int count = 0;
    s->shared->nearest_utime = -1;
    if (!s->next || !s->track.background.data)
        return;
    for (service *each = s; each; each = each->next) {
        double const seconds = 1e-6 * (double)(utime - each->last_utime);
        if (each->state != GAITMSG_STATUS_T_RUNNING || each->last_status == GAIT_TRACK_INIT ||
            each->last_status == GAIT_TRACK_LOST || seconds < 0)
            continue;
        body[count] = (nearest_body){each->person, each->last};
        if (gait_tracker_predict(each->track.tracker, &body[count].state, 1, seconds, NULL) == GAIT_OK)
            count++;
    }
    if (count < 2)
        return;
    nearest_draw(s->track.model, &s->track.config.camera[0], body, count, s->track.drawing, s->track.nearest);
    s->shared->nearest_utime = utime;
}

/* One person's part of service_frame(). */
static void frame_of(service *s, const image_view *v, bool newest, int64_t arrival_utime)
{
    int64_t const now = clock_wall(), birth = budget_birth(v->utime, arrival_utime);
    bool const repeated = s->state == GAITMSG_STATUS_T_RUNNING && is_repeated(s, v);
    count_gap(s, v);
    log_idle(s);
    if (s->state == GAITMSG_STATUS_T_ARMED && !begin(s, v))
        return;
    if (s->state == GAITMSG_STATUS_T_READY && newest && !start_with_first(s, v))
        return;
    if (s->state != GAITMSG_STATUS_T_RUNNING)
        return;
    s->last_arrived = v->utime;
    bool const due = !repeated || s->missed; /* to be counted as dropped unless it is tracked */
    s->counts.dropped -= repeated && s->missed;
    s->missed = !(fresh(s, newest, birth, now) && in_time(s, v) && step(s, v, now, birth)) && due;
    s->counts.dropped += s->missed;
}

void service_frame(service *s, const image_view *v, bool newest, int64_t arrival_utime)
{
    s->track.decoded.data = NULL;
    if (s->track.tracker && newest)
        draw_nearest(s, v->utime);
    for (service *each = s; each; each = each->next)
        frame_of(each, v, newest, arrival_utime);
}
