/* lift.c - speed of lifting with each instruction set: microseconds of CPU per frame of a stream of 15 points,
 * including the estimate; segments per second, with one gain for all and one by one; and whether the fastest set
 * reaches the targets. */
#include "gait_lift.h"
#include "trackd/common.h"
#include "trackd/options.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { POINTS = 15, RATE = 30, BATCH = 200 };

#define WANTED_US       50.0    /* of a frame, on one core */
#define WANTED_SEGMENTS 10000.0 /* a second */

static struct settings {
    char model[OPTION_TEXT];
    int32_t frames, lag;
} settings = {.model = "python/gait/data/walk.gait", .frames = 3000, .lag = 5};

static const option options[] = {
    {"model", 'm', "FILE", "blob with a segment prior, default python/gait/data/walk.gait", OPTION_TEXTUAL,
     settings.model, 0, 0},
    {"frames", 'n', "N", "frames of the stream, default 3000", OPTION_INT, &settings.frames, 100, 1000000},
    {"lag", 0, "N", "frames an estimate waits, default 5", OPTION_INT, &settings.lag, 0, 64},
};
enum { OPTIONS = sizeof options / sizeof *options };

typedef struct bench {
    model_file file;
    gait_lift_info info;
    gait_lift *lift;
    void *memory;
    size_t bytes;
    double *uv, *sd, *mean;    /* a segment; BATCH of them */
    double frame_us, segments; /* of the last instruction set: mean of a frame; by the gain, a second */
} bench;

/* CPU time of this thread, microseconds. */
static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static gait_lift_config config(uint32_t mask, int projection)
{
    gait_lift_config c;
    gait_lift_default(&c);
    c.projection = projection;
    c.heading_sd = projection == GAIT_LIFT_ORTHOGRAPHIC ? 0.0 : c.heading_sd;
    c.camera = (gait_camera){.width = 1280,
                             .height = 720,
                             .fx = 1000,
                             .fy = 1000,
                             .cx = 640,
                             .cy = 360,
                             .R = {1, 0, 0, 0, 0, -1, 0, 1, 0},
                             .t = {0, 1, 6}};
    c.lag = settings.lag;
    c.fit_threshold = 0.0; /* the person is drawn, not real */
    c.report = (1u << POINTS) - 1;
    c.cpu_mask = mask;
    return c;
}

static bool open_lift(bench *b, const gait_lift_config *c)
{
    gait_error err = {0};
    size_t bytes;
    bool ok = gait_lift_bytes(b->file.model, c, &bytes, &err) == GAIT_OK;
    if (ok && bytes > b->bytes) {
        free(b->memory);
        b->memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
        b->bytes = bytes;
    }
    ok = ok && b->memory && gait_lift_init(b->memory, bytes, b->file.model, c, &b->lift, &err) == GAIT_OK;
    if (!ok)
        fprintf(stderr, "lift: %s: %s\n", settings.model, b->memory ? err.text : "not enough memory");
    return ok;
}

static int by_size(const void *a, const void *b)
{
    double const x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Points of a figure that walks to and fro in front of the camera, with roughly a body's proportions. */
static void see(double time, double *uv)
{
    double const along = 1.5 * sin(0.5 * time);
    for (int j = 0; j < POINTS; j++) {
        double const side = j % 2 ? 0.12 : -0.12, height = 0.1 + 0.11 * j, swing = 0.2 * sin(5.8 * time + j);
        double const depth = 6.0 + side;
        uv[2 * j] = 1000.0 * (along + (j < 10 ? swing * (1.0 - height) : 0.0)) / depth + 640.0;
        uv[2 * j + 1] = 1000.0 * (1.0 - height) / depth + 360.0;
    }
}

/* Microseconds of push and estimate, frame by frame. */
static bool stream(bench *b, uint32_t mask)
{
    static gait_lift_frame out;
    gait_lift_config const c = config(mask, GAIT_LIFT_PERSPECTIVE);
    double *const took = malloc((size_t)settings.frames * sizeof *took);
    double start_us = 0.0, sum = 0.0;
    int32_t count = 0;
    bool ok = took && open_lift(b, &c);
    for (int32_t i = 0; ok && i < settings.frames; i++) {
        see((double)i / RATE, b->uv);
        double const before = now();
        ok = gait_lift_push(b->lift, 1000 + (int64_t)i * 1000000 / RATE, b->uv, b->sd, NULL) == GAIT_OK;
        bool const there =
            gait_lift_estimate(b->lift, &out, NULL) == GAIT_OK && out.status == GAIT_TRACK_TRACKING;
        double const us = now() - before;
        if (there && start_us == 0.0) {
            start_us = us; /* the heading was searched for */
        } else if (there) {
            took[count++] = us;
            sum += us;
        }
    }
    if (ok && count > 0) {
        b->frame_us = sum / count;
        qsort(took, (size_t)count, sizeof *took, by_size);
        printf("stream  %-7s %3d points  us/frame mean %6.1f median %6.1f p99 %6.1f max %6.1f  start %.0f us "
               " %zu bytes\n",
               gait_cpu_name(mask), POINTS, b->frame_us, took[count / 2], took[(int)(0.99 * count)],
               took[count - 1], start_us, b->bytes);
    }
    free(took);
    return ok;
}

/* Segments a second, by the gain (the matrix from pixels to the mean, computed once as what is seen stays the same) and
 * one by one; heading known, orthographic. */
static bool batch(bench *b, uint32_t mask)
{
    gait_lift_config const c = config(mask, GAIT_LIFT_ORTHOGRAPHIC);
    size_t const points = (size_t)b->info.frames * (size_t)b->info.markers;
    gait_lift_fit fit;
    if (!open_lift(b, &c) || gait_lift_fix(b->lift, b->sd, NULL) != GAIT_OK)
        return false;
    for (size_t i = 0; i < points * 2 * BATCH; i++)
        b->uv[i] = 0.3 * sin(0.1 * (double)i);
    double const before = now();
    for (int k = 0; k < 10; k++)
        if (gait_lift_batch(b->lift, BATCH, b->uv, b->mean, NULL) != GAIT_OK)
            return false;
    double const gain_us = (now() - before) / (10 * BATCH);
    double const middle = now();
    for (int k = 0; k < BATCH; k++)
        if (gait_lift_segment(b->lift, b->uv + (size_t)k * points * 2, b->sd, &fit, NULL) != GAIT_OK)
            return false;
    double const each_us = (now() - middle) / BATCH;
    b->segments = 1e6 / gain_us;
    printf("batch   %-7s %3d points  segments/s by the gain %.0f, one by one %.0f (%.1f and %.1f us)\n",
           gait_cpu_name(mask), POINTS, b->segments, 1e6 / each_us, gain_us, each_us);
    return true;
}

/* Memory for BATCH segments in which the first 15 markers are observed. */
static bool prepare(bench *b, message *why)
{
    gait_error err = {0};
    if (!model_file_open(&b->file, settings.model, why))
        return false;
    if (gait_lift_get_info(b->file.model, &b->info, &err) != GAIT_OK)
        return message_set(why, "%.100s: %.120s", settings.model, err.text);
    size_t const points = (size_t)b->info.frames * (size_t)b->info.markers;
    b->uv = calloc(points * BATCH * 2, sizeof *b->uv);
    b->mean = calloc(points * BATCH * 3, sizeof *b->mean);
    b->sd = calloc(points, sizeof *b->sd);
    for (size_t i = 0; b->sd && i < points; i++)
        b->sd[i] = (int32_t)(i % (size_t)b->info.markers) < POINTS ? 3.0 : -1.0;
    return (b->uv && b->mean && b->sd) || message_set(why, "not enough memory");
}

static void verdict(const bench *b)
{
    printf("\nThe best instruction set                 wanted  this run\n");
    printf("stream, us/frame of %d points, mean      < %4.0f  %8.1f  %s\n", POINTS, WANTED_US, b->frame_us,
           b->frame_us < WANTED_US ? "reached" : "MISSED");
    printf("batch by the gain, segments a second   >= %5.0f  %8.0f  %s\n", WANTED_SEGMENTS, b->segments,
           b->segments >= WANTED_SEGMENTS ? "reached" : "MISSED");
    printf("(gain: the matrix from pixels to the mean, computed once while the same points are observed)\n");
}

int main(int argc, char **argv)
{
    static bench b;
    message why;
    option_result const result = options_parse(options, OPTIONS, argc, argv, &why);
    if (result == OPTION_HELP) {
        printf("usage: lift [options]\n\nCPU time of lifting on this machine.\n\n");
        options_help(options, OPTIONS);
        return 0;
    }
    bool ok = result == OPTION_OK && prepare(&b, &why);
    if (!ok)
        fprintf(stderr, "lift: %s\n", why.text);
    for (uint32_t mask = 0; ok && mask <= gait_cpu_features(); mask = 2 * mask + 1)
        ok = stream(&b, mask) && batch(&b, mask);
    if (ok)
        verdict(&b);
    free(b.uv);
    free(b.mean);
    free(b.sd);
    free(b.memory);
    model_file_close(&b.file);
    return ok ? 0 : result == OPTION_BAD ? 2 : 1;
}
