#include "settings.h"

#include "gait_pool.h"
#include "lcm_link.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#define TEXT(field)           OPTION_TEXTUAL, s->field, 0, 0
#define INT(field, low, high) OPTION_INT, &s->field, low, high
#define FLAG(field)           OPTION_FLAG, &s->field, 0, 0

enum { OWN = 30, OPTIONS = OWN + TRACKER_OPTIONS };
static char particles_help[80], search_help[160]; /* written by say_defaults() */

/* Options that write into `s`. */
static void make_table(settings *s, option *table)
{
    const option own[] = {
        {"model", 'm', "FILE", "model blob (.gait), from `gait learn`; needed", TEXT(model)},
        {"camera", 0, "FILE",
         "camera JSON; without it the camera comes over GAIT_CAMERA_<i> from `gait capture`,\n"
         "        which also reads OpenCV YAML/XML and TOML",
         TEXT(camera)},
        {"background", 0, "FILE", "empty scene, PGM or PPM; without it GAIT_BACKGROUND_<i>",
         TEXT(background)},
        {"init", 0, "FILE|auto",
         "where the walker is at one frame (JSON); auto, the default: start with whoever walks through\n"
         "        the empty scene in full view for a second, and again after losing them; a START on\n"
         "        GAIT_COMMAND begins as well, with either",
         TEXT(init)},
        {"url", 0, "URL",
         "LCM to listen on, default $LCM_DEFAULT_URL or " LINK_DEFAULT_URL ";\n"
         "        file://LOG?speed=0 plays a log without loss and ends with it",
         TEXT(url)},
        {"out", 0, "URL",
         "LCM to publish on, default --url; for a log: nowhere, or file://NEW?mode=w, or mode=a\n        to "
         "add to one",
         TEXT(out)},
        {"config", 0, "FILE",
         "lines `name = value` with the long names of these options; the command line wins", TEXT(config)},
        {"stream", 0, "I", "number of the camera, default 0", INT(stream, 0, 30)},
        {"mode", 0, "default|paper", "all likelihood terms, or those of Ormoneit et al. 2000", TEXT(mode)},
        {"particles", 'n', "N", particles_help, INT(particles, 16, 1 << 20)},
        {"budget-ms", 0, "MS",
         "live: frames that cannot be answered within so many milliseconds of their capture are\n"
         "        dropped and counted; a frame whose stamp is more than a second off, or of the future, "
         "counts\n"
         "        from its arrival; default: none",
         OPTION_FLOAT, &s->budget_ms, 1, 10000},
        {"adapt-particles", 0, "LOW",
         "with --budget-ms: take fewer particles, down to LOW, when steps are too slow or frames are\n"
         "        dropped, and double them, up to --particles, when there is time to spare; results\n"
         "        then depend on time; default: their number never changes",
         INT(adapt_particles, 16, 1 << 20)},
        {"acquisition-particles", 0, "N", search_help, INT(acquisition_particles, 0, 1 << 20)},
        {"components", 0, "Q", "principal components in use; default the first 5, in paper mode all",
         INT(components, 0, GAIT_MAX_COMPONENTS)},
        {"lag", 0, "N",
         "frames that GAIT_ESTIMATE_LAG and GAIT_STRIDE wait for, default 5; 0: no GAIT_ESTIMATE_LAG",
         INT(lag, 0, 64)},
        {"seed", 0, "N", "of the random numbers, default 1", OPTION_U64, &s->seed, 0, 0},
        {"threads", 't', "N", "default 1; results do not depend on it", INT(threads, 1, GAIT_POOL_MAX)},
        {"tasks", 0, "N",
         "pieces of a step that can be worked on at once, default --threads, each with memory of its\n"
         "        own; results do not depend on it",
         INT(tasks, 1, 256)},
        {"cpu-mask", 0, "N",
         "instruction sets that may be used, added up: 1 SSE2 or NEON, 2 AVX2, 4 AVX-512; 0: none;\n"
         "        default all that the CPU has; results do not depend on it",
         INT(cpu_mask, 0, GAIT_CPU_BASE | GAIT_CPU_AVX2 | GAIT_CPU_AVX512)},
        {"max-gap", 0, "S",
         "longest pause between frames, default 2 seconds: one longer than --max-dt is bridged by\n"
         "        predictions of at most --max-dt each; after one longer than this, or a clock set back as\n"
         "        far, the tracker stops: --init auto looks for somebody anew, --init FILE waits for a START",
         OPTION_FLOAT, &s->max_gap, 0, 60},
        {"particles-channel", 0, "", "publish every hypothesis on GAIT_PARTICLES", FLAG(particles_channel)},
        {"tracks-term", 0, "",
         "the tracker also heeds 2-D joints of a detector, GAIT_TRACKS_<i> with the capture time of the\n"
         "        frame; a frame waits for its joints until the next one comes",
         FLAG(tracks_term)},
        {"tracks-sd", 0, "PX",
         "standard deviation of a joint with confidence 1, what a detector's joints differ from the\n"
         "        model's by included, default 4 pixels",
         OPTION_FLOAT, &s->tracks_sd, 0.01, 1000},
        {"lift", 0, "",
         "also lift 2-D tracks of joints, GAIT_TRACKS_<i>, to 3-D joints with standard deviations on\n"
         "        GAIT_LIFT, by the segment prior of the model",
         FLAG(lift)},
        {"lift-model", 0, "FILE", "blob with that segment prior, default --model", TEXT(lift_model)},
        {"lift-height", 0, "M", "height of the person lifted, default the mean of those learnt from",
         OPTION_FLOAT, &s->lift_stature, 0.5, 2.5},
        {"lift-sd", 0, "PX", "standard deviation of a point with confidence 1, default 3 pixels",
         OPTION_FLOAT, &s->lift_sd, 0.01, 1000},
        {"lift-lag", 0, "N", "frames that GAIT_LIFT waits for later ones, default 5", INT(lift_lag, 0, 64)},
        {"version", 0, "", "say the version, and whether JPEG frames are understood", FLAG(version)},
        {"quiet", 'q', "", "no word of where it listens, no summary at the end", FLAG(quiet)},
    };
    _Static_assert(sizeof own / sizeof *own == OWN, "every option has a place");
    _Static_assert((int)OPTIONS <= (int)OPTIONS_MOST, "a configuration file can set every option");
    memcpy(table, own, sizeof own);
    tracker_options_table(&s->tracker, table + OWN);
}

static void set_defaults(settings *s)
{
    *s = (settings){.mode = "default",
                    .init = "auto",
                    .components = -1,
                    .threads = 1,
                    .lag = 5,
                    .acquisition_particles = -1,
                    .cpu_mask = -1,
                    .seed = 1,
                    .max_gap = 2,
                    .lift_lag = -1};
}

/* The defaults of the library that the help names. */
static void say_defaults(void)
{
    gait_tracker_config usual, paper;
    gait_tracker_default(&usual, GAIT_MODE_DEFAULT);
    gait_tracker_default(&paper, GAIT_MODE_PAPER);
    snprintf(particles_help, sizeof particles_help, "hypotheses; default %d, paper mode %d",
             (int)usual.particles, (int)paper.particles);
    snprintf(search_help, sizeof search_help,
             "a search, until left and right are known, takes twice the hypotheses, up to N; default %d,\n"
             "        paper mode %d: no more than --particles",
             (int)usual.acquisition_particles, (int)paper.acquisition_particles);
}

void settings_help(void)
{
    static settings s;
    option table[OPTIONS];
    make_table(&s, table);
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

static int32_t mode(const settings *s)
{
    return strcmp(s->mode, "paper") == 0 ? GAIT_MODE_PAPER : GAIT_MODE_DEFAULT;
}

static int32_t particles(const settings *s)
{
    gait_tracker_config usual;
    gait_tracker_default(&usual, mode(s));
    return s->particles ? s->particles : usual.particles;
}

/* An option that only means something with another one is refused without it. */
static bool check_company(const settings *s, message *why)
{
    struct {
        const char *option, *needs;
        bool given, there;
    } const pair[] = {
        {"adapt-particles", "budget-ms", s->adapt_particles > 0, s->budget_ms > 0},
        {"background", "camera", s->background[0], s->camera[0]},
        {"lift-model", "lift", s->lift_model[0], s->lift},
        {"lift-height", "lift", s->lift_stature > 0, s->lift},
        {"lift-sd", "lift", s->lift_sd > 0, s->lift},
        {"lift-lag", "lift", s->lift_lag >= 0, s->lift},
        {"tracks-sd", "tracks-term", s->tracks_sd > 0, s->tracks_term},
    };
    for (size_t i = 0; i < sizeof pair / sizeof *pair; i++)
        if (pair[i].given && !pair[i].there)
            return message_set(why, "--%s needs --%s", pair[i].option, pair[i].needs);
    return true;
}

static bool same_file(const char *a, const char *b)
{
    struct stat x, y;
    return stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

/* The log played is only read; the one written is new, and none of the files that are read. */
static bool check_logs(const settings *s, message *why)
{
    char from[LINK_PATH] = "", to[LINK_PATH];
    const char *const read[] = {from, s->model, s->camera, s->background, s->init, s->config, s->lift_model};
    if (link_is_log(link_url(s->url)) && link_log(link_url(s->url), from) != 'r')
        return message_set(why, "--url %.160s: a log to listen to is only read; leave ?mode= out",
                           link_url(s->url));
    if (!link_is_log(s->out))
        return true;
    char const mode = link_log(s->out, to);
    if (mode != 'w' && mode != 'a')
        return message_set(
            why, "--out %.160s: gives no log to write; add ?mode=w (new) or ?mode=a (at its end)", s->out);
    for (size_t i = 0; i < sizeof read / sizeof *read; i++)
        if (read[i][0] && same_file(read[i], to))
            return message_set(why, "--out %.160s: would overwrite %.40s, which is read; give another name",
                               s->out, i ? "a file" : "the log of --url");
    return true;
}

option_result settings_read(settings *s, int argc, char **argv, message *why)
{
    option table[OPTIONS];
    set_defaults(s);
    make_table(s, table);
    option_result result = options_parse(table, OPTIONS, argc, argv, why);
    if (result == OPTION_OK && s->config[0])
        result = options_file(table, OPTIONS, s->config, why) ? options_parse(table, OPTIONS, argc, argv, why)
                                                              : OPTION_BAD;
    if (result != OPTION_OK)
        return result;
    bool const ok =
        (s->model[0] || s->version || message_set(why, "--model FILE is needed; `gait learn` makes one")) &&
        (strcmp(s->mode, "paper") == 0 || strcmp(s->mode, "default") == 0 ||
         message_set(why, "--mode %.100s: give default or paper", s->mode)) &&
        (strncmp(link_url(s->url), "memq://", 7) != 0 ||
         message_set(why, "--url memq://: reaches nobody outside one process; give udpm:// or file://")) &&
        (s->budget_ms == 0 || !link_is_log(link_url(s->url)) ||
         message_set(why, "--budget-ms: a log is played without loss; leave it out")) &&
        check_company(s, why) && check_logs(s, why) &&
        (s->adapt_particles <= particles(s) ||
         message_set(why, "--adapt-particles %d: at most the %d of --particles", (int)s->adapt_particles,
                     (int)particles(s)));
    return ok ? OPTION_OK : OPTION_BAD;
}

void settings_tracker(const settings *s, gait_tasks exec, gait_tracker_config *c)
{
    gait_tracker_default(c, mode(s));
    c->particles = particles(s);
    if (s->acquisition_particles >= 0)
        c->acquisition_particles = s->acquisition_particles;
    c->components = s->components;
    c->seed = s->seed;
    c->lag = s->lag;
    c->cpu_mask = (uint32_t)s->cpu_mask;
    c->tasks = s->tasks ? s->tasks : s->threads;
    c->exec = exec;
    if (s->tracks_term)
        c->terms |= GAIT_TERM_KEYPOINTS;
    tracker_options_apply(&s->tracker, c);
}
