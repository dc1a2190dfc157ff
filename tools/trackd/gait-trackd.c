/* gait-trackd - track a person in frames that arrive over LCM.  `gait-trackd --help` is the manual. */
#include "trackd/cameras.h"
#include "trackd/input_files.h"
#include "trackd/image_view.h"
#include "trackd/lcm_link.h"
#include "trackd/manager.h"
#include "trackd/receiver.h"
#include "trackd/settings.h"
#include "trackd/common.h"

#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { QUIT = 1, RELOAD = 2 };
static volatile sig_atomic_t quit;    /* 0 until a signal sets QUIT or RELOAD */
static sig_atomic_t on_hangup = QUIT; /* SIGHUP from a closed terminal; RELOAD: under a service manager */

static void on_signal(int number)
{
    quit = number == SIGHUP && quit != QUIT ? on_hangup
                                            : QUIT; /* QUIT wins if both are delivered, in any order */
}

/* Block the signals that end the program, also in threads that LCM starts; `unblocked` is the mask to wait with. */
static void set_signals(sigset_t *unblocked)
{
    static const int ends[] = {SIGINT, SIGTERM, SIGHUP};
    struct sigaction const action = {.sa_handler = on_signal};
    sigset_t block;
    on_hangup = manager_listens() ? RELOAD : QUIT;
    sigemptyset(&block);
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        struct sigaction before;
        if (ends[i] == SIGHUP && sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler == SIG_IGN)
            continue; /* started by nohup */
        sigaddset(&block, ends[i]);
        sigaction(ends[i], &action, NULL);
    }
    sigprocmask(SIG_BLOCK, &block, unblocked);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); /* a log that exceeds the limit is then a write error */
}

static bool read_background(service *s, const char *path, message *why)
{
    file_bytes bytes;
    gait_image plate;
    if (!path[0])
        return true;
    if (!pnm_read(path, &bytes, &plate, why))
        return false;
    message bad;
    bool const ok = tracking_set_background(&s->track, &plate, &bad) ||
                    message_set(why, "%.100s: %.140s", path, bad.text);
    free(bytes.data);
    return ok;
}

typedef struct parts { /* optional parts of the service */
    lift_service lift;
    keypoint_cue cue;
    pose_path path;
    further further;
    pose_path further_path[FURTHER_MOST];
    service other[PEOPLE_MOST - 1]; /* people besides the first */
    keypoint_cue other_cue[PEOPLE_MOST - 1];
} parts;

typedef struct instance { /* the service with its settings and all that it needs */
    settings want;
    service_shared shared;
    service service;
    parts extra;
    workers threads;
    snapshot_file snapshot;
    receiver receiver;
    sink out;
    bool trial; /* opened only to see whether it can be: nothing is changed, and only a fault is reported */
} instance;

/* Open the lifter, if requested. */
static bool load_lift(service *s, const settings *want, lift_service *lift, sink *out, message *why)
{
    lift_settings const set = {.stature = want->lift_stature,
                               .sd = want->lift_sd,
                               .lag = want->lift_lag,
                               .cpu_mask = (uint32_t)want->cpu_mask,
                               .person = want->person};
    const char *const model = want->lift_model[0] ? want->lift_model : want->model;
    if (!want->lift)
        return true;
    if (!lift_service_open(lift, model, &set, out, why))
        return false;
    s->shared->lift = lift;
    s->track.memory_bytes += lift->file.bytes + lift->memory_bytes;
    return true;
}

static void open_cue(service *s, const settings *want, keypoint_cue *cue)
{
    keypoint_cue_open(cue, s->track.model, s->track.info.joints,
                      want->keypoints_sd > 0 ? want->keypoints_sd : 4);
}

/* All cameras move. */
static void open_paths(service *s, const settings *want, parts *p)
{
    pose_path const none = {.turn_sd = want->pose_turn_sd / 57.29578f, .place_sd = want->pose_place_sd};
    p->path = none;
    s->shared->path = &p->path;
    for (int i = 0; i < p->further.count; i++) {
        p->further_path[i] = none;
        p->further.camera[i].path = &p->further_path[i];
    }
}

/* The services of further people. */
static bool add_people(service *s, const settings *want, parts *p, message *why)
{
    for (int k = 0; k + 1 < want->people; k++) {
        open_cue(s, want, &p->other_cue[k]);
        service_share(&p->other[k], s, k + 2, &p->other_cue[k]);
        if (!service_open(&p->other[k], NULL, want->particles_channel, why))
            return false;
    }
    return true;
}

/* Load model, start, camera and background, as far as the command line gives them. */
static bool load(service *s, const settings *want, parts *p, workers *threads, sink *out, message *why)
{
    gait_tracker_config config;
    gait_camera camera;
    init_state init;
    bool const has_init = strcmp(want->init, "auto") != 0;
    settings_tracker(want, gait_pool_tasks(threads->pool), &config);
    if (!tracking_open(&s->track, want->model, &config, why))
        return false;
    if ((has_init && !init_file_read(want->init, s->track.model, &init, why)) ||
        !load_lift(s, want, &p->lift, out, why))
        return false;
    if (want->keypoints_term) {
        open_cue(s, want, &p->cue);
        s->cue = &p->cue;
    }
    (void)further_open(&p->further, want->further_streams, want->stream, why); /* checked with the settings */
    s->shared->further = p->further.count ? &p->further : NULL;
    if (want->moving_camera)
        open_paths(s, want, p);
    s->shared->out = out;
    s->shared->stream = want->stream;
    s->shared->threads = want->threads;
    s->shared->max_gap = (double)want->max_gap;
    s->shared->max_pixels = want->max_pixels;
    s->budget = (budget){.limit_us = (int64_t)(1e3f * want->budget_ms),
                         .low = want->adapt_particles,
                         .high = config.particles};
    s->shared->pool_bytes = threads->bytes;
    s->track.memory_bytes += threads->bytes;
    if (!service_open(s, has_init ? &init : NULL, want->particles_channel, why) ||
        !add_people(s, want, p, why))
        return false;
    if (want->camera[0]) {
        if (!camera_file_read(want->camera, &camera, why))
            return false;
        s->shared->slot.fixed = true;
        camera_use(&s->shared->slot, &camera);
        if (!service_make_trackers(s, why))
            return false;
    }
    if (!read_background(s, want->background, why))
        return false;
    service_share_background(s);
    return true;
}

static void print_summary(const service *s, bool live)
{
    const service_counts *const c = &s->counts;
    const pose_path *const path = s->shared->path;
    const further *const more = s->shared->further;
    const lift_service *const lift = s->shared->lift;
    printf("frames %" PRId64 " dropped %" PRId64 " rejected %" PRId64, c->frames, c->dropped, c->rejected);
    printf(" step_ms median %.2f p99 %.2f max %.2f", histogram_quantile(&c->step, 0.5) / 1e3,
           histogram_quantile(&c->step, 0.99) / 1e3, c->step.largest / 1e3);
    if (live)
        printf(" latency_ms median %.2f p99 %.2f", histogram_quantile(&c->latency, 0.5) / 1e3,
               histogram_quantile(&c->latency, 0.99) / 1e3);
    if (s->budget.limit_us)
        printf(" late %" PRId64 " over_budget %" PRId64 " particles %d slow_steps %" PRId64, s->budget.late,
               s->budget.over, (int)(s->wanted ? s->wanted : s->track.config.particles),
               s->budget.slow_steps);
    if (s->cue)
        printf(" keypoint_messages %" PRId64 " keypoints_used %" PRId64 " keypoints_late %" PRId64
               " keypoints_left_out %" PRId64,
               s->cue->messages, s->cue->used, s->cue->late, s->cue->filter.left_out);
    if (path)
        printf(" poses_refused %" PRId64 " frames_without_pose %" PRId64, path->refused, path->unknown);
    for (int i = 0; more && i < more->count; i++) {
        const further_camera *const each = &more->camera[i];
        printf(" stream_%d_used %" PRId64 " stream_%d_missing %" PRId64, each->stream, each->used,
               each->stream, each->missing);
        if (each->path)
            printf(" stream_%d_poses_refused %" PRId64 " stream_%d_frames_without_pose %" PRId64,
                   each->stream, each->path->refused, each->stream, each->path->unknown);
    }
    if (lift)
        printf(" lift_frames %" PRId64 " lifted %" PRId64 " lift_rejected %" PRId64
               " lift_keypoints_left_out %" PRId64 " lift_ms median %.3f p99 %.3f",
               lift->frames, lift->lifted, lift->rejected, lift->filter.left_out,
               histogram_quantile(&lift->step, 0.5) / 1e3, histogram_quantile(&lift->step, 0.99) / 1e3);
    printf(" memory_bytes %zu digest %016" PRIx64 "\n", s->track.memory_bytes, service_digest(s));
}

/* Whether anything in a log was tracked or lifted; if not, report what is missing. */
static bool check_result(const char *path, const service *s, message *why)
{
    int64_t const keypoints = s->shared->lift ? s->shared->lift->frames : 0;
    message lack = s->complaint;
    for (const service *each = s; each; each = each->next)
        if (each->tracked > 0)
            return true;
    if (s->shared->lift && s->shared->lift->lifted > 0)
        return true;
    if (s->shared->arrived == 0 && keypoints == 0)
        return message_set(why, "%.200s: no frames on GAIT_IMAGE_%d%s; --stream selects another camera", path,
                           s->shared->stream, s->shared->lift ? " and no keypoints of a known camera" : "");
    if (s->shared->arrived == 0)
        return message_set(why, "%.200s: none of its %" PRId64 " messages of keypoints was lifted: %.200s",
                           path, keypoints, lack.text[0] ? lack.text : "too few");
    service_lack(s, &lack);
    return message_set(why, "%.200s: none of its %" PRId64 " frames was tracked: %.200s", path,
                       s->shared->arrived, lack.text);
}

/* Whether the log that was played is complete and gave a result. */
static bool check_log(const char *url, const service *s, message *why)
{
    char path[LINK_PATH];
    link_log(url, path);
    log_scan(path, why);
    return !why->text[0] && check_result(path, s, why);
}

typedef struct invocation { /* of the program */
    int argc;
    char **argv;
    sigset_t unblocked; /* signal mask at the start, and while waiting */
} invocation;

/* Open everything that the settings name. */
static bool open_instance(instance *n, message *why)
{
    const settings *const want = &n->want;
    service *const s = &n->service;
    const char *const url = link_url(want->url);
    const char *const to = want->out[0] ? want->out : link_is_log(url) ? NULL : url;
    n->snapshot =
        (snapshot_file){.path = want->snapshot[0] ? want->snapshot : NULL,
                        .period = (int64_t)(1e6 * (want->snapshot_s > 0 ? (double)want->snapshot_s : 1))};
    n->shared.quiet = n->trial;
    s->shared = &n->shared;
    s->person = want->people ? 1 : want->person;
    return workers_start(&n->threads, want->threads, why) && snapshot_file_check(&n->snapshot, why) &&
           load(s, want, &n->extra, &n->threads, &n->out, why) &&
           receiver_open(&n->receiver, s, &n->snapshot, url, why) &&
           (!to || n->trial || sink_open(&n->out, to, why)); /* last: it makes a file */
}

/* Close it; `ok` as it was, or false if messages were lost. */
static bool close_instance(instance *n, bool ok, message *why)
{
    receiver_close(&n->receiver);
    ok = sink_close(&n->out, ok, why);
    workers_stop(&n->threads);
    for (service *each = n->service.next; each; each = each->next)
        service_close(each);
    service_close(&n->service);
    service_shared_close(&n->shared);
    lift_service_close(&n->extra.lift);
    further_close(&n->extra.further);
    return ok;
}

/* Whether the program can start with the settings as they are now: all that they name is opened, and closed again.  `own` is
 * the output in use. */
static bool can_reload(const invocation *call, const sink *own, message *why)
{
    static instance next;
    memset(&next, 0, sizeof next);
    next.trial = true;
    if (settings_read(&next.want, call->argc, call->argv, why) != OPTION_OK)
        return false;
    const char *const url = link_url(next.want.url), *const to = next.want.out[0] ? next.want.out : url;
    if (link_is_log(url))
        return message_set(why, "--url %.160s: a log is played only from the start of the program", url);
    bool const ok = sink_check(to, own, why) && open_instance(&next, why);
    return close_instance(&next, ok, why);
}

/* Run until a signal ends the program or new settings are to be used; if the program could not start with these, continue
 * with the present ones. */
static bool run(instance *n, const invocation *call, message *why)
{
    message bad;
    while (receiver_run(&n->receiver, &quit, &call->unblocked, why)) {
        manager_report(quit == RELOAD ? "RELOADING=1" : "STOPPING=1");
        if (quit != RELOAD || can_reload(call, &n->out, &bad))
            return true;
        log_line("settings were not reloaded: %s", bad.text);
        manager_report("READY=1");
        quit = 0;
    }
    return false;
}

/* Run the service with its settings, from opening it to the summary. */
static bool serve(instance *n, const invocation *call, message *why)
{
    service *const s = &n->service;
    const settings *const want = &n->want;
    const char *const url = link_url(want->url);
    bool const log = link_is_log(url), ready = open_instance(n, why);
    if (ready)
        snapshot_file_resume(&n->snapshot, s);
    if (ready && !log && !want->quiet)
        log_line("listening on %s", url);
    if (ready)
        manager_report("READY=1");
    bool ok = ready && run(n, call, why);
    if (ok) {
        snapshot_file_write(&n->snapshot, s, true);
        for (service *each = s; each; each = each->next) {
            service_send_status(each);
            if (want->people && !want->quiet)
                printf("person %d ", each->person);
            if (!want->quiet)
                print_summary(each, !log);
        }
    }
    if (ok && log)
        ok = check_log(url, s, why);
    return close_instance(n, ok, why);
}

/* A service manager starts the program again at once, as after a crash: do not spin. */
static int failed(const message *why, int code)
{
    log_line("%s", why->text);
    if (manager_listens())
        sleep(1);
    return code;
}

/* Exit code of an answer on stdout. */
static int answered(void)
{
    message why;
    if (fflush(stdout) == 0 && !ferror(stdout))
        return 0;
    (void)message_set(&why, "stdout cannot be written: %s", strerror(errno));
    return failed(&why, 1);
}

int main(int argc, char **argv)
{
    static instance only;
    invocation call = {.argc = argc, .argv = argv};
    message why;
    option_result const result = settings_read(&only.want, argc, argv, &why);
    if (result == OPTION_BAD)
        return failed(&why, 2);
    if (result == OPTION_HELP) {
        settings_help();
        return answered();
    }
    if (only.want.version) {
        uint32_t const v = gait_version();
        printf("gait-trackd %u.%u.%u jpeg %s\n", v / 10000, v / 100 % 100, v % 100,
               jpeg_supported() ? "yes" : "no");
        return answered();
    }
    set_signals(&call.unblocked);
    bool ok = serve(&only, &call, &why);
    if (ok && quit == RELOAD) {
        fflush(stdout);
        sigprocmask(SIG_SETMASK, &call.unblocked, NULL); /* delivers what came during the reload */
        signal(SIGTERM, SIG_DFL);                        /* from here on as in the new program */
        signal(SIGINT, SIG_DFL);
        if (quit == QUIT) {
            manager_report("STOPPING=1");
            return 0;
        }
        execvp(argv[0], argv);
        ok = message_set(&why, "%.200s: cannot be restarted: %s", argv[0], strerror(errno));
    }
    return ok ? 0 : failed(&why, 1);
}
