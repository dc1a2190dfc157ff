/* step.c - time of a tracker step: a drawn walker crosses a textured scene, for each number of particles and
 * threads.  The digest of a number of particles must not depend on the threads. */
#include "common/file.h"
#include "common/histogram.h"
#include "common/options.h"
#include "common/workers.h"

#include <inttypes.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { WIDTH = 640, HEIGHT = 480, MAX_FRAMES = 300, MAX_SWEEP = 8 };

typedef struct scene {
    gait_camera camera;
    uint8_t plate[HEIGHT * WIDTH], frame[MAX_FRAMES][HEIGHT * WIDTH];
    gait_state start;
} scene;

typedef struct settings {
    char model[OPTION_TEXT], particles[OPTION_TEXT], threads[OPTION_TEXT];
    int32_t frames;
} settings;

/* A pattern with detail at the scale of some pixels. */
static uint8_t pattern(int x, int y, unsigned seed)
{
    unsigned h = (unsigned)(x / 5) * 73856093u ^ (unsigned)(y / 7) * 19349663u ^ seed * 83492791u;
    h = (h ^ (h >> 13)) * 0x5bd1e995u;
    return (uint8_t)(h >> 24);
}

/* A limb's cloth: its own grey level and some detail. */
static uint8_t cloth(uint8_t id, int x, int y)
{
    return (uint8_t)(40 + 13 * (id % 14) + pattern(x, y, id) / 16);
}

static gait_status scene_make(scene *s, const gait_model *model, int32_t frames)
{
    static uint8_t ids[HEIGHT * WIDTH];
    gait_model_info info;
    gait_state walker = {.stature = 1.75f};
    /* 8 m to the side of the path, 1.4 m up. */
    s->camera = (gait_camera){.width = WIDTH,
                              .height = HEIGHT,
                              .fx = 800,
                              .fy = 800,
                              .cx = 320,
                              .cy = 240,
                              .R = {1, 0, 0, 0, 0, -1, 0, 1, 0},
                              .t = {0, 1.4f, 8}};
    gait_status status = gait_model_get_info(model, &info);
    walker.stride_hz = info.stride_hz;
    walker.pelvis[0] = -0.5f * (float)frames / 30 * walker.stature * info.stride_hz * info.stride_length;
    for (int i = 0; i < HEIGHT * WIDTH; i++)
        s->plate[i] = (uint8_t)(64 + pattern(i % WIDTH, i / WIDTH, 0) / 2);
    for (int32_t f = 0; f < frames && status == GAIT_OK; f++) {
        status = gait_model_pelvis_height(model, &walker, &walker.pelvis[2]);
        if (f == 0)
            s->start = walker;
        if (status == GAIT_OK)
            status = gait_render(model, &s->camera, &walker, ids, WIDTH);
        for (int i = 0; i < HEIGHT * WIDTH; i++)
            s->frame[f][i] = ids[i] ? cloth(ids[i], i % WIDTH, i / WIDTH) : s->plate[i];
        walker.phase = fmodf(walker.phase + info.stride_hz / 30, 1);
        walker.pelvis[0] += walker.stature * info.stride_hz * info.stride_length / 30;
    }
    return status;
}

static int64_t now_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

static gait_image grey(const uint8_t *pixels)
{
    return (gait_image){
        .data = pixels, .width = WIDTH, .height = HEIGHT, .stride = WIDTH, .format = GAIT_GREY8};
}

/* Track the scene in the given memory; a row of the table goes to stdout. */
static gait_status run(gait_tracker *t, const scene *s, int32_t frames, histogram *times, gait_error *err)
{
    gait_state const sd = {.phase = 0.05f,
                           .stride_hz = 0.05f,
                           .stature = 0.03f,
                           .heading = 0.1f,
                           .pelvis = {0.05f, 0.05f, 0.02f},
                           .pitch = 0.02f,
                           .roll = 0.02f};
    gait_image const plate = grey(s->plate);
    gait_estimate estimate;
    gait_status status = gait_tracker_set_background(t, 0, &plate);
    if (status == GAIT_OK)
        status = gait_tracker_start(t, &s->start, &sd, 0, err);
    for (int32_t f = 0; f < frames && status == GAIT_OK; f++) {
        gait_frame const frame = {.utime = (int64_t)f * 1000000 / 30, .image = {grey(s->frame[f])}};
        int64_t const begin = now_us();
        status = gait_tracker_step(t, &frame, &estimate, err);
        histogram_add(times, now_us() - begin);
    }
    return status;
}

/* One row: one tracker of n particles on some threads.  digest: what the others of its size gave, or 0. */
static bool measure(const gait_model *model, const scene *s, int32_t n, int threads, int32_t frames,
                    uint64_t *digest, message *why)
{
    workers crew;
    histogram times = {0};
    gait_tracker_config cfg;
    gait_error err = {.text = ""};
    gait_tracker *tracker = NULL;
    size_t bytes = 0;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    cfg.particles = n;
    cfg.camera[0] = s->camera;
    if (gait_tracker_bytes(model, &cfg, &bytes, &err) != GAIT_OK)
        return message_set(why, "%s", err.text);
    if (!workers_start(&crew, threads, why))
        return false;
    cfg.exec = gait_pool_tasks(crew.pool);
    void *const memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
    gait_status status =
        memory ? gait_tracker_init(memory, bytes, model, &cfg, &tracker, &err) : GAIT_ERR_MEMORY;
    if (status == GAIT_OK)
        status = run(tracker, s, frames, &times, &err);
    uint64_t const have = status == GAIT_OK ? gait_tracker_digest(tracker) : 0;
    workers_stop(&crew);
    free(memory);
    if (status != GAIT_OK)
        return message_set(why, "%s: %s", gait_status_name(status), err.text);
    double const median = histogram_quantile(&times, 0.5) / 1e3;
    printf("%9" PRId32 " %7d %9zu %9.2f %8.2f %8.1f  %016" PRIx64 "\n", n, threads, bytes / 1024, median,
           histogram_quantile(&times, 0.99) / 1e3, 1e3 / median, have);
    fflush(stdout);
    if (*digest && *digest != have)
        return message_set(why, "%" PRId32 " particles: the digest depends on the threads", n);
    *digest = have;
    return true;
}

/* "100,1000" to numbers in [1, high]; returns how many, 0 if it is not such a list. */
static int numbers(const char *text, long high, int32_t out[MAX_SWEEP])
{
    int count = 0;
    for (char *end; count < MAX_SWEEP; text = end + 1) {
        long const v = strtol(text, &end, 10);
        if (end == text || v < 1 || v > high || (*end != ',' && *end != '\0'))
            return 0;
        out[count++] = (int32_t)v;
        if (*end == '\0')
            return count;
    }
    return 0;
}

static bool bench(const settings *set, message *why)
{
    static scene s;
    int32_t particles[MAX_SWEEP], threads[MAX_SWEEP];
    int const sizes = numbers(set->particles, 1 << 20, particles),
              counts = numbers(set->threads, GAIT_POOL_MAX, threads);
    file_bytes blob;
    gait_error err = {.text = ""};
    gait_model *model = NULL;
    size_t bytes = 0;
    if (!sizes || !counts)
        return message_set(why, "--particles and --threads want up to %d numbers like 100,1000", MAX_SWEEP);
    if (!file_read(set->model, "model", &blob, why))
        return false;
    bool ok = gait_model_bytes(blob.data, blob.size, &bytes, &err) == GAIT_OK;
    void *const memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN) / GAIT_ALIGN * GAIT_ALIGN);
    ok = ok && memory && gait_model_init(memory, bytes, blob.data, blob.size, &model, &err) == GAIT_OK;
    if (!ok)
        message_set(why, "%s: %s", set->model, err.text);
    else if (scene_make(&s, model, set->frames) != GAIT_OK)
        ok = message_set(why, "%s: the walker cannot be drawn", set->model);
    else
        printf("particles threads memory_kB median_ms   p99_ms      fps  digest\n");
    for (int i = 0; ok && i < sizes; i++) {
        uint64_t digest = 0;
        for (int k = 0; ok && k < counts; k++)
            ok = measure(model, &s, particles[i], threads[k], set->frames, &digest, why);
    }
    free(memory);
    free(blob.data);
    return ok;
}

int main(int argc, char **argv)
{
    settings set = {"python/gait/data/walk.gait", "300,1000,3000", "1,2", 90};
    const option table[] = {
        {"model", 'm', "FILE", "model blob", OPTION_TEXTUAL, set.model, 0, 0},
        {"particles", 'n', "N,N...", "numbers of particles, default 300,1000,3000", OPTION_TEXTUAL,
         set.particles, 0, 0},
        {"threads", 't', "N,N...", "numbers of threads, default 1,2", OPTION_TEXTUAL, set.threads, 0, 0},
        {"frames", 'f', "N", "frames to track, default 90", OPTION_INT, &set.frames, 2, MAX_FRAMES},
    };
    int const count = sizeof table / sizeof *table;
    message why = {""};
    option_result const parsed = options_parse(table, count, argc, argv, &why);
    if (parsed == OPTION_HELP) {
        printf("usage: step [options]\n\nTime a tracker step on a drawn walker, %d x %d.\n\n", WIDTH, HEIGHT);
        options_help(table, count);
        return 0;
    }
    if (parsed == OPTION_BAD || !bench(&set, &why)) {
        fprintf(stderr, "step: %s\n", why.text);
        return parsed == OPTION_BAD ? 2 : 1;
    }
    return 0;
}
