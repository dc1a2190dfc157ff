#include "settings.h"

#include "further.h"
#include "gait_pool.h"
#include "input_files.h"
#include "lcm_link.h"
#include "nearest.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

/* ---- settings of the tracker, from their table in gait.h ---- */
typedef struct setting {
    const char *name, *type, *unit, *meaning;
    size_t offset;
    double usual, paper, low, high;
} setting;

#define ROW(name, type, unit, meaning, usual, paper, low, high)                                              \
    {#name,           #type,           unit, meaning, offsetof(gait_tracker_config, name),                   \
     (double)(usual), (double)(paper), low,  high},
#define SETTING(meaning, type, name, array, unit, usual, low, high)                                          \
    ROW(name, type, unit, meaning, usual, usual, low, high)
#define PAPER(meaning, type, name, array, unit, usual, paper, low, high)                                     \
    ROW(name, type, unit, meaning, usual, paper, low, high)
#define FIELD(...)

enum { USUAL_LAG = 5 }; /* frames; the library keeps none by default, because they take memory */

static const setting SETTINGS[] = {GAIT_TRACKER_CONFIG_FIELDS(SETTING, PAPER, FIELD)};
enum { SETTING_COUNT = sizeof SETTINGS / sizeof *SETTINGS };

static bool kind_of(const setting *s, option_kind *kind)
{
    if (strcmp(s->name, "seed") == 0)
        *kind = OPTION_U64;
    else if (strcmp(s->type, "float") == 0)
        *kind = OPTION_FLOAT;
    else if (strcmp(s->type, "double") == 0)
        *kind = OPTION_DOUBLE;
    else if (strcmp(s->type, "int32_t") == 0 && strcmp(s->name, "cameras") != 0)
        *kind = OPTION_INT;
    else
        return false;
    return true;
}

/* "rejuvenation-time" */
static const char *option_name(const setting *s)
{
    static char names[SETTING_COUNT][32];
    char *const name = names[s - SETTINGS];
    snprintf(name, sizeof names[0], "%s", s->name);
    for (char *c = name; *c; c++)
        *c = *c == '_' ? '-' : *c;
    return name;
}

/* Meaning, unit, default. */
static const char *option_help(const setting *s)
{
    static char helps[SETTING_COUNT][256];
    char *const help = helps[s - SETTINGS];
    char usual[40], paper[40] = "";
    snprintf(usual, sizeof usual, "%g", strcmp(s->name, "lag") == 0 ? USUAL_LAG : s->usual);
    if (strcmp(s->name, "tasks") == 0)
        snprintf(usual, sizeof usual, "the number of --threads");
    if (s->paper != s->usual)
        snprintf(paper, sizeof paper, ", paper mode %g", s->paper);
    snprintf(help, sizeof helps[0], "%s\n        %s%sdefault %s%s", s->meaning, s->unit, *s->unit ? "; " : "",
             usual, paper);
    return help;
}

/* Fill `table` with options that write into `config`, and return how many: every number with a range but `cameras`. */
static int tracker_options(gait_tracker_config *config, option *table)
{
    int count = 0;
    for (int i = 0; i < SETTING_COUNT; i++) {
        const setting *const s = &SETTINGS[i];
        option_kind kind;
        if (kind_of(s, &kind))
            table[count++] = (option){.name = option_name(s),
                                      .letter = strcmp(s->name, "particles") == 0 ? 'n' : 0,
                                      .metavar = kind == OPTION_INT || kind == OPTION_U64 ? "N" : "X",
                                      .help = option_help(s),
                                      .kind = kind,
                                      .value = (char *)config + s->offset,
                                      .low = s->low,
                                      .high = s->high};
    }
    return count;
}

/* ---- options of the daemon ---- */
#define TEXT(field)           OPTION_TEXTUAL, s->field, 0, 0
#define INT(field, low, high) OPTION_INT, &s->field, low, high
#define FLAG(field)           OPTION_FLAG, &s->field, 0, 0

/* Fill `table` with options that write into `s`, and return how many. */
static int make_table(settings *s, option *table)
{
    const option own[] = {
        {"model", 'm', "FILE",
         "model (.gait) from `gait learn`, or a folder with walk.gait (in paper mode paper.gait); required",
         TEXT(model)},
        {"camera", 0, "FILE",
         "camera JSON; without it the camera comes on GAIT_CAMERA_<i> from `gait capture`, which also\n"
         "        reads OpenCV YAML/XML and TOML",
         TEXT(camera)},
        {"background", 0, "FILE", "empty scene, PGM or PPM; without it GAIT_BACKGROUND_<i>",
         TEXT(background)},
        {"init", 0, "FILE|auto",
         "state of the person in one frame (JSON); auto, the default: start when a person has walked\n"
         "        through the empty scene in full view for a second, and again after losing them; a START\n"
         "        on GAIT_COMMAND always starts the tracker, too",
         TEXT(init)},
        {"url", 0, "URL",
         "LCM URL to listen on, default $LCM_DEFAULT_URL or " LINK_DEFAULT_URL ";\n"
         "        file://LOG?speed=0 plays a log without dropping frames, and then ends",
         TEXT(url)},
        {"out", 0, "URL",
         "LCM URL to publish on, default --url; when playing a log: none by default, or file://NEW?mode=w\n"
         "        (?mode=a to append)",
         TEXT(out)},
        {"config", 0, "FILE",
         "TOML: lines `name = value` with the long names of these options, texts in quotes, flags true or\n"
         "        false; the command line takes precedence",
         TEXT(config)},
        {"snapshot", 0, "FILE",
         "live, with --init auto: save the state of every tracker in FILE while someone is followed, and\n"
         "        resume from it at the next start; a folder in memory, such as /run, spares the disk",
         TEXT(snapshot)},
        {"snapshot-s", 0, "S", "seconds between two snapshots, default 1", OPTION_FLOAT, &s->snapshot_s, 0.1,
         3600},
        {"stream", 0, "I", "number of the camera, default 0", INT(stream, 0, 30)},
        {"further-streams", 0, "I,J",
         "numbers of further cameras, up to three, that see the same person at the same time: their frames\n"
         "        are taken with the frame of --stream nearest in time; a frame waits for them until the "
         "next\n"
         "        one arrives, and does without those that are missing",
         TEXT(further_streams)},
        {"person", 0, "N",
         "of several people track person N, with the keypoints on GAIT_TRACKS_<i>_<N>, and answer on\n"
         "        GAIT_ESTIMATE_<N> and so on: all channels but those of the camera end in _<N>",
         INT(person, 1, PEOPLE_MOST)},
        {"people", 0, "N",
         "track persons 1 to N, each as --person does, and take into account that one may hide another",
         INT(people, 1, PEOPLE_MOST)},
        {"mode", 0, "default|paper", "all likelihood terms, or those of Ormoneit et al. 2000", TEXT(mode)},
        {"budget-ms", 0, "MS",
         "live: drop and count frames that cannot be answered within MS milliseconds of their capture; a\n"
         "        frame whose time stamp is more than a second old, or in the future, counts from its\n"
         "        arrival; default: no limit",
         OPTION_FLOAT, &s->budget_ms, 1, 10000},
        {"adapt-particles", 0, "LOW",
         "with --budget-ms: use fewer particles, down to LOW, when steps are too slow or frames are\n"
         "        dropped, and double them, up to --particles, when there is time to spare; results then\n"
         "        depend on timing; default: constant",
         INT(adapt_particles, 16, 1 << 20)},
        {"max-pixels", 0, "N",
         "most pixels of all cameras together: a camera message with more is rejected, so that it\n"
         "        cannot exhaust memory; default 8388608, enough for four cameras of 1920x1080",
         INT(max_pixels, 1, GAIT_MAX_PIXELS * GAIT_MAX_PIXELS)},
        {"threads", 't', "N", "threads, default 1; results do not depend on it",
         INT(threads, 1, GAIT_POOL_MAX)},
        {"cpu-mask", 0, "N",
         "sum of the instruction sets to use: 1 SSE2 or NEON, 2 AVX2, 4 AVX-512, 8 SSE4.1; 0: none;\n"
         "        default all that the CPU has; results do not depend on it",
         INT(cpu_mask, 0, GAIT_CPU_BASE | GAIT_CPU_SSE4 | GAIT_CPU_AVX2 | GAIT_CPU_AVX512)},
        {"max-gap", 0, "S",
         "longest pause between frames, default 2 seconds. Pauses longer than --max-dt are bridged by\n"
         "        predictions of at most --max-dt each. After a pause longer than S, or if the clock is set\n"
         "        back by more, the tracker stops: --init auto searches again, --init FILE waits for START",
         OPTION_FLOAT, &s->max_gap, 0, 60},
        {"particles-channel", 0, "", "publish every particle on GAIT_PARTICLES", FLAG(particles_channel)},
        {"keypoints-term", 0, "",
         "also use a detector's 2-D keypoints, from GAIT_TRACKS_<i> with the capture time of the frame; a\n"
         "        frame waits for its keypoints until the next frame arrives",
         FLAG(keypoints_term)},
        {"keypoints-sd", 0, "PX",
         "standard deviation of a keypoint with confidence 1, including the difference between the\n"
         "        detector's joints and the model's, default 4 pixels; not for messages that state it\n"
         "        (tracks2_t)",
         OPTION_FLOAT, &s->keypoints_sd, 0.01, 1000},
        {"moving-camera", 0, "",
         "the cameras move: each message on GAIT_CAMERA_<i> gives the pose at that time; poses are\n"
         "        interpolated, and a frame waits for its pose until the next frame arrives",
         FLAG(moving_camera)},
        {"pose-turn-sd", 0, "DEG", "standard deviation of the rotation of these poses, default 0 degrees",
         OPTION_FLOAT, &s->pose_turn_sd, 0, 10},
        {"pose-place-sd", 0, "M", "standard deviation of their positions, default 0 metres", OPTION_FLOAT,
         &s->pose_place_sd, 0, 1},
        {"lift", 0, "",
         "also lift 2-D keypoints from GAIT_TRACKS_<i> to 3-D joints with standard deviations on\n"
         "        GAIT_LIFT, with the segment prior of the model",
         FLAG(lift)},
        {"lift-model", 0, "FILE", "model with the segment prior, default --model", TEXT(lift_model)},
        {"lift-stature", 0, "M",
         "stature of the person to lift in metres, default the mean of the training data", OPTION_FLOAT,
         &s->lift_stature, 0.5, 2.5},
        {"lift-sd", 0, "PX", "standard deviation of a keypoint with confidence 1, default 3 pixels; likewise",
         OPTION_FLOAT, &s->lift_sd, 0.01, 1000},
        {"lift-lag", 0, "N", "frames by which GAIT_LIFT is delayed, default 5", INT(lift_lag, 0, 64)},
        {"version", 0, "", "print the version and whether JPEG frames are supported", FLAG(version)},
        {"quiet", 'q', "", "do not print the URL at the start and the summary at the end", FLAG(quiet)},
    };
    int const count = (int)(sizeof own / sizeof *own);
    memcpy(table, own, sizeof own);
    return count + tracker_options(&s->tracker, table + count);
}

static void set_defaults(settings *s)
{
    *s = (settings){.mode = "default",
                    .init = "auto",
                    .threads = 1,
                    .cpu_mask = -1,
                    .max_pixels = 1 << 23,
                    .max_gap = 2,
                    .lift_lag = -1};
}

void settings_help(void)
{
    static settings s;
    option table[OPTIONS_MOST];
    int const count = make_table(&s, table);
    printf(
        "usage: gait-trackd -m MODEL.gait [--camera CAMERA.json] [--init INIT.json|auto] [options]\n\n"
        "Track a walking person in frames that arrive over LCM (GAIT_IMAGE_<i>).  Publishes estimates\n"
        "(GAIT_ESTIMATE), smoothed estimates a few frames later (GAIT_ESTIMATE_LAG), the time, length and\n"
        "speed of each stride (GAIT_STRIDE), and GAIT_STATUS once a second.  Live, only the newest frame is\n"
        "tracked; the others are counted as dropped.\n"
        "Accepts the commands START, STOP and RESET on GAIT_COMMAND.  SIGINT, SIGTERM or SIGHUP end the\n"
        "program with a summary; under a service manager SIGHUP reads --config again.  Exit codes: 0\n"
        "success, 1 failure, 2 wrong usage.\n\n");
    options_help(table, count);
}

static gait_mode mode(const settings *s)
{
    return strcmp(s->mode, "paper") == 0 ? GAIT_MODE_PAPER : GAIT_MODE_DEFAULT;
}

/* Reject an option that has no effect without another one. */
static bool check_dependencies(const settings *s, message *why)
{
    struct {
        const char *option, *needs;
        bool given, there;
    } const pair[] = {
        {"adapt-particles", "budget-ms", s->adapt_particles > 0, s->budget_ms > 0},
        {"background", "camera", s->background[0], s->camera[0]},
        {"lift-model", "lift", s->lift_model[0], s->lift},
        {"lift-stature", "lift", s->lift_stature > 0, s->lift},
        {"lift-sd", "lift", s->lift_sd > 0, s->lift},
        {"lift-lag", "lift", s->lift_lag >= 0, s->lift},
        {"snapshot-s", "snapshot", s->snapshot_s > 0, s->snapshot[0]},
        {"snapshot", "init auto", s->snapshot[0], strcmp(s->init, "auto") == 0},
        {"keypoints-sd", "keypoints-term", s->keypoints_sd > 0, s->keypoints_term},
        {"person", "keypoints-term", s->person > 0, s->keypoints_term},
        {"people", "keypoints-term", s->people > 0, s->keypoints_term},
        {"people", "init auto", s->people > 0, strcmp(s->init, "auto") == 0},
        {"people", "a single camera", s->people > 0, !s->further_streams[0]},
        {"people", "no --person", s->people > 0, !s->person},
        {"lift", "a single person: --person", s->lift, !s->people},
        {"pose-turn-sd", "moving-camera", s->pose_turn_sd > 0, s->moving_camera},
        {"pose-place-sd", "moving-camera", s->pose_place_sd > 0, s->moving_camera},
        {"lift", "a static camera", s->lift, !s->moving_camera},
        {"further-streams", "a background on GAIT_BACKGROUND_<i>, not --background", s->further_streams[0],
         !s->background[0]},
        {"background", "a static camera", s->background[0], !s->moving_camera},
    };
    for (size_t i = 0; i < sizeof pair / sizeof *pair; i++)
        if (pair[i].given && !pair[i].there)
            return message_set(why, "--%s needs %s%s", pair[i].option, pair[i].needs[1] == ' ' ? "" : "--",
                               pair[i].needs);
    return true;
}

static bool same_file(const char *a, const char *b)
{
    struct stat x, y;
    return stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

/* The log that is played is only read; the one that is written must not be one of the input files. */
static bool check_logs(const settings *s, message *why)
{
    char from[LINK_PATH] = "", to[LINK_PATH], unfinished[LINK_PATH];
    const char *const read[] = {from, s->model, s->camera, s->background, s->init, s->config, s->lift_model};
    if (link_is_log(link_url(s->url)) && link_log(link_url(s->url), from) != 'r')
        return message_set(why,
                           "--url %.160s: a log to play is only read; leave out ?mode=", link_url(s->url));
    if (!link_is_log(s->out))
        return true;
    char const mode = link_log(s->out, to);
    if (mode != 'w' && mode != 'a')
        return message_set(why, "--out %.160s: not a log to write; add ?mode=w (new) or ?mode=a (append)",
                           s->out);
    link_unfinished(to, unfinished);
    for (size_t i = 0; i < sizeof read / sizeof *read; i++)
        if (read[i][0] && (same_file(read[i], to) || same_file(read[i], unfinished)))
            return message_set(why,
                               "--out %.160s: would overwrite %.40s, which is an input; give another name",
                               s->out, i ? "a file" : "the log of --url");
    return true;
}

/* Set values from the file, if there is one, and then from the command line, which wins. */
static option_result parse(settings *s, const option *table, int count, int argc, char **argv, message *why)
{
    if (s->config[0] && !options_file(table, count, s->config, why))
        return OPTION_BAD;
    return options_parse(table, count, argc, argv, why);
}

/* If --model is a folder, choose the model of the mode in it. */
static bool choose_model(settings *s, message *why)
{
    char folder[OPTION_TEXT];
    struct stat x;
    if (!s->model[0] || stat(s->model, &x) != 0 || !S_ISDIR(x.st_mode))
        return true;
    memcpy(folder, s->model, sizeof folder);
    if (strlen(folder) + sizeof "/paper.gait" > sizeof s->model)
        return message_set(why, "--model %.100s: the name is too long", folder);
    snprintf(s->model, sizeof s->model, "%.*s/%s.gait", (int)(sizeof s->model - sizeof "/paper.gait"), folder,
             mode(s) == GAIT_MODE_PAPER ? "paper" : "walk");
    if (s->lift && !s->lift_model[0]) /* the paper's model has no segment prior */
        snprintf(s->lift_model, sizeof s->lift_model, "%.*s/walk.gait",
                 (int)(sizeof s->model - sizeof "/paper.gait"), folder);
    return true;
}

option_result settings_read(settings *s, int argc, char **argv, message *why)
{
    option table[OPTIONS_MOST];
    set_defaults(s);
    int const count = make_table(s, table);
    option_result result = options_parse(table, count, argc, argv, why); /* which file? */
    if (result == OPTION_OK)
        result = parse(s, table, count, argc, argv, why); /* which mode? */
    gait_tracker_default(&s->tracker, mode(s));
    s->tracker.tasks = 0;
    s->tracker.lag = USUAL_LAG;
    if (result == OPTION_OK)
        result = parse(s, table, count, argc, argv, why);
    if (result != OPTION_OK)
        return result;
    bool const ok =
        (s->model[0] || s->version ||
         message_set(why, "--model FILE is required; make one with `gait learn`")) &&
        (strcmp(s->mode, "paper") == 0 || strcmp(s->mode, "default") == 0 ||
         message_set(why, "--mode %.100s: give default or paper", s->mode)) &&
        (strncmp(link_url(s->url), "memq://", 7) != 0 ||
         message_set(why, "--url memq://: works only within one process; give udpm:// or file://")) &&
        (s->budget_ms == 0 || !link_is_log(link_url(s->url)) ||
         message_set(why, "--budget-ms: a log is played without dropping frames; leave out --budget-ms")) &&
        (!s->snapshot[0] || !link_is_log(link_url(s->url)) ||
         message_set(why, "--snapshot: a log is played from its start; leave out --snapshot")) &&
        further_open(&(further){0}, s->further_streams, s->stream, why) && check_dependencies(s, why) &&
        choose_model(s, why) && check_logs(s, why) &&
        (s->adapt_particles <= s->tracker.particles ||
         message_set(why, "--adapt-particles %d: at most the %d of --particles", (int)s->adapt_particles,
                     (int)s->tracker.particles));
    return ok ? OPTION_OK : OPTION_BAD;
}

void settings_tracker(const settings *s, gait_tasks exec, gait_tracker_config *c)
{
    *c = s->tracker;
    c->cpu_mask = (uint32_t)s->cpu_mask;
    c->tasks = c->tasks ? c->tasks : s->threads;
    c->exec = exec;
    if (s->keypoints_term)
        c->terms |= GAIT_TERM_KEYPOINTS;
}
