/* gait-trackd - frames in, estimates out, over LCM.  `gait-trackd --help` is the manual. */
#include "common/camera_file.h"
#include "common/jpeg.h"
#include "common/link.h"
#include "common/pnm.h"
#include "common/receiver.h"
#include "common/tracker_options.h"
#include "common/workers.h"

#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct settings {
    char model[OPTION_TEXT], camera[OPTION_TEXT], background[OPTION_TEXT], init[OPTION_TEXT];
    char url[OPTION_TEXT], out[OPTION_TEXT], config[OPTION_TEXT], mode[OPTION_TEXT];
    int32_t stream, particles, adapt_particles, components, threads, tasks, lag, cpu_mask;
    uint64_t seed;
    float max_gap, budget_ms;
    char lift_model[OPTION_TEXT];
    float lift_stature, lift_sd;
    int32_t lift_lag;
    float tracks_sd;
    bool particles_channel, quiet, version, lift, tracks_term;
    tracker_values tracker;
} settings = {.mode = "default",
              .init = "auto",
              .components = -1,
              .threads = 1,
              .lag = 5,
              .cpu_mask = -1,
              .seed = 1,
              .max_gap = 2,
              .lift_lag = -1};

#define TEXT(field)           OPTION_TEXTUAL, settings.field, 0, 0
#define INT(field, low, high) OPTION_INT, &settings.field, low, high
#define FLAG(field)           OPTION_FLAG, &settings.field, 0, 0

enum { PIECES = 4 };                             /* for each thread, so that none waits long for another */
static char particles_help[80], tasks_help[120]; /* written by say_defaults() */

static const option own_options[] = {
    {"model", 'm', "FILE", "model blob (.gait), from `gait learn`; needed", TEXT(model)},
    {"camera", 0, "FILE",
     "camera JSON; without it the camera comes over GAIT_CAMERA_<i> from `gait capture`,\n"
     "        which also reads OpenCV YAML/XML and TOML",
     TEXT(camera)},
    {"background", 0, "FILE", "empty scene, PGM or PPM; without it GAIT_BACKGROUND_<i>", TEXT(background)},
    {"init", 0, "FILE|auto",
     "where the walker is at one frame (JSON); auto: start with whoever walks\n"
     "        through the empty scene in full view for a second, or wait for START on GAIT_COMMAND",
     TEXT(init)},
    {"url", 0, "URL",
     "LCM to listen on, default $LCM_DEFAULT_URL or " LINK_DEFAULT_URL ";\n"
     "        file://LOG?speed=0 plays a log without loss and ends with it",
     TEXT(url)},
    {"out", 0, "URL", "LCM to publish on, default --url; for a log: nowhere, or file://NEW?mode=w",
     TEXT(out)},
    {"config", 0, "FILE", "lines `name = value` with the long names of these options; the command line wins",
     TEXT(config)},
    {"stream", 0, "I", "number of the camera, default 0", INT(stream, 0, 30)},
    {"mode", 0, "default|paper", "all likelihood terms, or those of Ormoneit et al. 2000", TEXT(mode)},
    {"particles", 'n', "N", particles_help, INT(particles, 16, 1 << 20)},
    {"budget-ms", 0, "MS",
     "live: frames that cannot be answered within so many milliseconds of their capture are\n"
     "        dropped and counted; default: none",
     OPTION_FLOAT, &settings.budget_ms, 1, 10000},
    {"adapt-particles", 0, "LOW",
     "with --budget-ms: halve the particles, down to LOW, when steps are too slow or frames are\n"
     "        dropped, and double them, up to --particles, when there is time to spare; results\n"
     "        then depend on time; default: their number never changes",
     INT(adapt_particles, 16, 1 << 20)},
    {"components", 0, "Q", "principal components in use; default all of the model's",
     INT(components, 0, GAIT_MAX_COMPONENTS)},
    {"lag", 0, "N",
     "frames that GAIT_ESTIMATE_LAG and GAIT_STRIDE wait for, default 5; 0: no GAIT_ESTIMATE_LAG",
     INT(lag, 0, 64)},
    {"seed", 0, "N", "of the random numbers, default 1", OPTION_U64, &settings.seed, 0, 0},
    {"threads", 't', "N", "default 1; results do not depend on it", INT(threads, 1, GAIT_POOL_MAX)},
    {"tasks", 0, "N", tasks_help, INT(tasks, 1, 256)},
    {"cpu-mask", 0, "N",
     "instruction sets that may be used, added up: 1 SSE2 or NEON, 2 AVX2, 4 AVX-512; 0: none;\n"
     "        default all that the CPU has; results do not depend on it",
     INT(cpu_mask, 0, GAIT_CPU_BASE | GAIT_CPU_AVX2 | GAIT_CPU_AVX512)},
    {"max-gap", 0, "S", "longest pause between frames that is bridged by prediction, default 2 seconds",
     OPTION_FLOAT, &settings.max_gap, 0, 60},
    {"particles-channel", 0, "", "publish every hypothesis on GAIT_PARTICLES", FLAG(particles_channel)},
    {"tracks-term", 0, "",
     "the tracker also heeds 2-D joints of a detector, GAIT_TRACKS_<i> with the capture time of the\n"
     "        frame; a frame waits for its joints until the next one comes",
     FLAG(tracks_term)},
    {"tracks-sd", 0, "PX",
     "standard deviation of a joint with confidence 1, what a detector's joints differ from the\n"
     "        model's by included, default 4 pixels",
     OPTION_FLOAT, &settings.tracks_sd, 0.01, 1000},
    {"lift", 0, "",
     "also lift 2-D tracks of joints, GAIT_TRACKS_<i>, to 3-D joints with standard deviations on\n"
     "        GAIT_LIFT, by the segment prior of the model",
     FLAG(lift)},
    {"lift-model", 0, "FILE", "blob with that segment prior, default --model", TEXT(lift_model)},
    {"lift-height", 0, "M", "height of the person lifted, default the mean of those learnt from",
     OPTION_FLOAT, &settings.lift_stature, 0.5, 2.5},
    {"lift-sd", 0, "PX", "standard deviation of a point with confidence 1, default 3 pixels", OPTION_FLOAT,
     &settings.lift_sd, 0.01, 1000},
    {"lift-lag", 0, "N", "frames that GAIT_LIFT waits for later ones, default 5", INT(lift_lag, 0, 64)},
    {"version", 0, "", "say the version, and whether JPEG frames are understood", FLAG(version)},
    {"quiet", 'q', "", "no summary at the end", FLAG(quiet)},
};
enum { OWN = sizeof own_options / sizeof *own_options, OPTIONS = OWN + TRACKER_OPTIONS };

static volatile sig_atomic_t quit;

static void on_signal(int number)
{
    (void)number;
    quit = 1;
}

/* Block the signals that end us, in every thread LCM will start; `unblocked` is the mask to wait with. */
static void set_signals(sigset_t *unblocked)
{
    struct sigaction const action = {.sa_handler = on_signal};
    sigset_t block;
    sigemptyset(&block);
    sigaddset(&block, SIGINT);
    sigaddset(&block, SIGTERM);
    sigprocmask(SIG_BLOCK, &block, unblocked);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
}

/* The defaults of the library that the help names. */
static void say_defaults(void)
{
    gait_tracker_config usual, paper;
    gait_tracker_default(&usual, GAIT_MODE_DEFAULT);
    gait_tracker_default(&paper, GAIT_MODE_PAPER);
    snprintf(particles_help, sizeof particles_help, "hypotheses; default %d, paper mode %d",
             (int)usual.particles, (int)paper.particles);
    snprintf(tasks_help, sizeof tasks_help,
             "pieces of a step for the threads, default %d or, if more, %d per thread;\n"
             "        results do not depend on it",
             (int)usual.tasks, PIECES);
}

static void help(const option *table)
{
    say_defaults();
    printf(
        "usage: gait-trackd -m MODEL.gait [--camera CAMERA.json] [--init INIT.json|auto] [options]\n\n"
        "Track a walking person: frames come over LCM (GAIT_IMAGE_<i>), estimates go out (GAIT_ESTIMATE,\n"
        "and GAIT_ESTIMATE_LAG: a few frames late, by what was seen since), each stride with its time, "
        "length\n"
        "and speed (GAIT_STRIDE), and GAIT_STATUS once a second.  Live, the newest frame wins and the "
        "others\n"
        "are counted as dropped.\n"
        "Commands START, STOP and RESET come over GAIT_COMMAND.  SIGINT or SIGTERM end the program with a\n"
        "summary.  Exit codes: 0 ok, 1 failed, 2 usage.\n\n");
    options_help(table, OPTIONS);
}

static int32_t mode(void)
{
    return strcmp(settings.mode, "paper") == 0 ? GAIT_MODE_PAPER : GAIT_MODE_DEFAULT;
}

static int32_t particles(void)
{
    gait_tracker_config usual;
    gait_tracker_default(&usual, mode());
    return settings.particles ? settings.particles : usual.particles;
}

/* An option that only means something with another one is refused without it. */
static bool check_company(message *why)
{
    struct {
        const char *option, *needs;
        bool given, there;
    } const pair[] = {
        {"adapt-particles", "budget-ms", settings.adapt_particles > 0, settings.budget_ms > 0},
        {"background", "camera", settings.background[0], settings.camera[0]},
        {"lift-model", "lift", settings.lift_model[0], settings.lift},
        {"lift-height", "lift", settings.lift_stature > 0, settings.lift},
        {"lift-sd", "lift", settings.lift_sd > 0, settings.lift},
        {"lift-lag", "lift", settings.lift_lag >= 0, settings.lift},
        {"tracks-sd", "tracks-term", settings.tracks_sd > 0, settings.tracks_term},
    };
    for (size_t i = 0; i < sizeof pair / sizeof *pair; i++)
        if (pair[i].given && !pair[i].there)
            return message_set(why, "--%s needs --%s", pair[i].option, pair[i].needs);
    return true;
}

/* Command line over configuration file over defaults. */
static option_result read_settings(int argc, char **argv, const option *table, message *why)
{
    option_result result = options_parse(table, OPTIONS, argc, argv, why);
    if (result == OPTION_OK && settings.config[0])
        result = options_file(table, OPTIONS, settings.config, why)
                     ? options_parse(table, OPTIONS, argc, argv, why)
                     : OPTION_BAD;
    if (result != OPTION_OK)
        return result;
    bool const ok =
        (settings.model[0] || settings.version ||
         message_set(why, "--model FILE is needed; `gait learn` makes one")) &&
        (strcmp(settings.mode, "paper") == 0 || strcmp(settings.mode, "default") == 0 ||
         message_set(why, "--mode %.100s: give default or paper", settings.mode)) &&
        (strncmp(link_url(settings.url), "memq://", 7) != 0 ||
         message_set(why, "--url memq://: reaches nobody outside one process; give udpm:// or file://")) &&
        (settings.budget_ms == 0 || !link_is_log(link_url(settings.url)) ||
         message_set(why, "--budget-ms: a log is played without loss; leave it out")) &&
        check_company(why) &&
        (settings.adapt_particles <= particles() ||
         message_set(why, "--adapt-particles %d: at most the %d of --particles",
                     (int)settings.adapt_particles, (int)particles()));
    return ok ? OPTION_OK : OPTION_BAD;
}

static void make_config(workers *threads, gait_tracker_config *c)
{
    gait_tracker_default(c, mode());
    c->particles = particles();
    c->components = settings.components;
    c->seed = settings.seed;
    c->lag = settings.lag;
    c->cpu_mask = (uint32_t)settings.cpu_mask;
    if (settings.tasks)
        c->tasks = settings.tasks;
    else if (c->tasks < PIECES * settings.threads)
        c->tasks = PIECES * settings.threads < 256 ? PIECES * settings.threads : 256;
    c->exec = gait_pool_tasks(threads->pool);
    if (settings.tracks_term)
        c->terms |= GAIT_TERM_TRACKS;
    tracker_options_apply(&settings.tracker, c);
}

static bool read_background(service *s, message *why)
{
    file_bytes bytes;
    gait_image plate;
    if (!settings.background[0])
        return true;
    if (!pnm_read(settings.background, &bytes, &plate, why))
        return false;
    message bad;
    bool const ok = tracking_set_background(&s->track, &plate, &bad) ||
                    message_set(why, "%.100s: %.140s", settings.background, bad.text);
    free(bytes.data);
    return ok;
}

typedef struct parts { /* those that a service may lack */
    lift_service lift;
    tracks_cue cue;
} parts;

/* The second service, if it is asked for. */
static bool load_lift(service *s, lift_service *lift, lcm_t *out, message *why)
{
    lift_settings const set = {.stature = settings.lift_stature,
                               .sd = settings.lift_sd > 0 ? settings.lift_sd : 3,
                               .lag = settings.lift_lag >= 0 ? settings.lift_lag : 5,
                               .cpu_mask = (uint32_t)settings.cpu_mask};
    const char *const model = settings.lift_model[0] ? settings.lift_model : settings.model;
    if (!settings.lift)
        return true;
    if (!lift_service_open(lift, model, &set, out, why))
        return false;
    s->lift = lift;
    s->track.memory_bytes += lift->blob.size + lift->memory_bytes;
    return true;
}

/* Model, start, camera and empty scene, as far as the command line gives them. */
static bool load(service *s, parts *p, workers *threads, lcm_t *out, message *why)
{
    gait_tracker_config config;
    gait_camera camera;
    init_state init;
    bool const has_init = strcmp(settings.init, "auto") != 0;
    make_config(threads, &config);
    if (!tracking_open(&s->track, settings.model, &config, why))
        return false;
    if ((has_init && !init_file_read(settings.init, s->track.model, &init, why)) ||
        !load_lift(s, &p->lift, out, why))
        return false;
    if (settings.tracks_term) {
        tracks_cue_open(&p->cue, s->track.model, s->track.info.joints,
                        settings.tracks_sd > 0 ? settings.tracks_sd : 4);
        s->cue = &p->cue;
    }
    s->max_gap = (double)settings.max_gap;
    s->budget = (budget){.limit_us = (int64_t)(1e3f * settings.budget_ms),
                         .low = settings.adapt_particles,
                         .high = config.particles};
    s->pool_bytes = threads->bytes;
    s->track.memory_bytes += threads->bytes;
    if (!service_open(s, out, settings.stream, settings.threads, has_init ? &init : NULL,
                      settings.particles_channel, why))
        return false;
    if (settings.camera[0] &&
        (!camera_file_read(settings.camera, &camera, why) || !service_set_camera(s, &camera, why) ||
         (s->lift && !lift_service_camera(s->lift, &camera, why))))
        return false;
    return read_background(s, why);
}

static void print_summary(const service *s, bool live)
{
    const service_counts *const c = &s->counts;
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
        printf(" tracks %" PRId64 " tracks_used %" PRId64 " tracks_late %" PRId64 " points_left_out %" PRId64,
               s->cue->messages, s->cue->used, s->cue->late, s->cue->sieve.left_out);
    if (s->lift)
        printf(" lift_frames %" PRId64 " lifted %" PRId64 " lift_rejected %" PRId64
               " lift_points_left_out %" PRId64 " lift_ms median %.3f p99 %.3f",
               s->lift->frames, s->lift->lifted, s->lift->rejected, s->lift->sieve.left_out,
               histogram_quantile(&s->lift->step, 0.5) / 1e3, histogram_quantile(&s->lift->step, 0.99) / 1e3);
    printf(" memory_bytes %zu digest %016" PRIx64 "\n", s->track.memory_bytes, service_digest(s));
}

/* Everything between the settings and the exit code. */
static bool serve(service *s, parts *p, workers *threads, const sigset_t *unblocked, message *why)
{
    const char *const url = link_url(settings.url);
    bool const log = link_is_log(url);
    const char *const to = settings.out[0] ? settings.out : log ? NULL : url;
    receiver r = {0};
    lcm_t *const out = to ? link_open(to, why) : NULL;
    bool const ok = (!to || out) && load(s, p, threads, out, why) && receiver_open(&r, s, url, why) &&
                    receiver_run(&r, &quit, unblocked, why);
    if (ok) {
        service_send_status(s);
        if (!settings.quiet)
            print_summary(s, !log);
    }
    receiver_close(&r);
    if (out)
        lcm_destroy(out);
    return ok;
}

int main(int argc, char **argv)
{
    static service s;
    static parts extra;
    static workers threads;
    option table[OPTIONS];
    sigset_t unblocked;
    message why;
    memcpy(table, own_options, sizeof own_options);
    tracker_options_table(&settings.tracker, table + OWN);
    option_result const result = read_settings(argc, argv, table, &why);
    if (result == OPTION_HELP)
        help(table);
    if (result == OPTION_BAD)
        fprintf(stderr, "gait-trackd: %s\n", why.text);
    if (result != OPTION_OK)
        return result == OPTION_HELP ? 0 : 2;
    if (settings.version) {
        uint32_t const v = gait_version();
        printf("gait-trackd %u.%u.%u jpeg %s\n", v / 10000, v / 100 % 100, v % 100,
               jpeg_supported() ? "yes" : "no");
        return 0;
    }
    set_signals(&unblocked);
    bool ok = workers_start(&threads, settings.threads, &why);
    if (ok) {
        ok = serve(&s, &extra, &threads, &unblocked, &why);
        workers_stop(&threads);
        service_close(&s);
        lift_service_close(&extra.lift);
        tracks_cue_close(&extra.cue);
    }
    if (!ok)
        fprintf(stderr, "gait-trackd: %s\n", why.text);
    return ok ? 0 : 1;
}
