/* A daemon without enough memory: whichever of its allocations fails, it is reported, and nothing is lost or half open.  Files
 * that cannot be read, and threads that cannot be started. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "gait.h"
#include "gait_pool.h"

static int allocations, fail_at; /* 0: none fails */
static bool short_read, no_stream, no_threads;

static bool fails(void)
{
    return ++allocations == fail_at;
}

static void *layer_malloc(size_t bytes)
{
    return fails() ? NULL : malloc(bytes);
}

static void *layer_aligned(size_t align, size_t bytes)
{
    return fails() ? NULL : aligned_alloc(align, bytes);
}

static size_t layer_fread(void *to, size_t each, size_t count, FILE *f)
{
    return fread(to, each, short_read ? count - 1 : count, f);
}

static FILE *layer_fdopen(int file, const char *mode)
{
    return no_stream ? NULL : fdopen(file, mode);
}

static gait_result layer_pool_init(void *memory, size_t bytes, int32_t threads, gait_pool **out,
                                   gait_error *err)
{
    if (no_threads)
        snprintf(err->text, sizeof err->text, "no more threads");
    return no_threads ? GAIT_ERR_STATE : gait_pool_init(memory, bytes, threads, out, err);
}

#define malloc         layer_malloc
#define aligned_alloc  layer_aligned
#define fread          layer_fread
#define fdopen         layer_fdopen
#define gait_pool_init layer_pool_init
#include "../../tools/trackd/common.c"
#include "../../tools/trackd/frame_hold.c"
#include "../../tools/trackd/service.c"
#undef malloc
#undef aligned_alloc
#undef fread
#undef fdopen
#undef gait_pool_init

#include "check.h"
#include "toy_model.h"
#include "toy_segment.h"
#include "toy_written.h"

static const gait_camera CAMERA = {48, 32, 50, 50, 24, 16, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};

static char model[] = P_tmpdir "/gait_memory_XXXXXX", segments[] = P_tmpdir "/gait_memory_XXXXXX";
static message why;

static struct parts {
    service_shared shared;
    service s, second;
    lift_service lift;
    further more;
    keypoint_cue cue, second_cue;
    workers pool;
    bool complete; /* but for the trackers */
} p;

/* Two people, a further camera, a lift, threads and the cloud of particles. */
static bool open_all(void)
{
    static sink out;
    gait_tracker_config config;
    lift_settings const set = {.sd = 3, .lag = 2, .cpu_mask = ~0u};
    gait_tracker_default(&config, GAIT_MODE_DEFAULT);
    config.particles = config.acquisition_particles = 16;
    p = (struct parts){
        .shared = {.out = &out, .lift = &p.lift, .further = &p.more, .max_pixels = 2 * 48 * 32},
        .s = {.shared = &p.shared, .person = 1}};
    if (!workers_start(&p.pool, 2, &why) || !tracking_open(&p.s.track, model, &config, &why) ||
        !lift_service_open(&p.lift, segments, &set, &out, &why) || !further_open(&p.more, "1", 0, &why))
        return false;
    keypoint_cue_open(&p.cue, p.s.track.model, p.s.track.info.joints, 4);
    keypoint_cue_open(&p.second_cue, p.s.track.model, p.s.track.info.joints, 4);
    p.s.cue = &p.cue;
    if (!service_open(&p.s, NULL, true, &why))
        return false;
    service_share(&p.second, &p.s, 2, &p.second_cue);
    camera_use(&p.shared.slot, &CAMERA);
    camera_use(&p.more.camera[0].slot, &CAMERA);
    if (!service_open(&p.second, NULL, true, &why) || !further_allocate(&p.more.camera[0], &why))
        return false;
    p.complete = true;
    return service_make_trackers(&p.s, &why);
}

static void close_all(void)
{
    service_close(&p.second);
    service_close(&p.s);
    service_shared_close(&p.shared);
    lift_service_close(&p.lift);
    further_close(&p.more);
    workers_stop(&p.pool);
}

static void test_every_allocation(void)
{
    allocations = fail_at = 0;
    CHECK(open_all() && p.second.track.tracker && p.shared.hold.frame);
    close_all();
    int const all = allocations;
    CHECK(all > 15);
    for (fail_at = 1; fail_at <= all; fail_at++) {
        allocations = 0;
        why.text[0] = '\0';
        CHECK(!open_all() && strstr(why.text, "not enough memory"));
        CHECK(!p.complete || !p.shared.slot.known); /* the camera has to be announced again */
        close_all();
    }
    fail_at = 0;
}

static void test_files(void)
{
    file_bytes file;
    model_file m;
    short_read = true;
    CHECK(!file_read(model, "model", FILE_MOST, &file, &why) &&
          strstr(why.text, "cannot be read completely"));
    CHECK(!file.data && file.size == 0);
    short_read = false;
    no_stream = true;
    CHECK(!file_read(model, "model", FILE_MOST, &file, &why) &&
          strstr(why.text, "cannot open the model file"));
    no_stream = false;
    CHECK(!file_read(P_tmpdir, "model", FILE_MOST, &file, &why) && strstr(why.text, "not a regular file"));
    CHECK(truncate(model, (off_t)100) == 0 && !model_file_open(&m, model, &why));
    CHECK(strstr(why.text, "not a usable model") && strstr(why.text, "learn it again or give another"));
    model_file_close(&m);
}

static void test_threads(void)
{
    workers w;
    CHECK(!workers_start(&w, 0, &why) && strstr(why.text, "--threads 0: "));
    no_threads = true;
    CHECK(!workers_start(&w, 2, &why) && strcmp(why.text, "--threads 2: no more threads") == 0);
    CHECK(!w.pool && !w.memory);
    no_threads = false;
}

int main(void)
{
    static uint8_t blob[TOY_BYTES];
    static toy_segments made;
    size_t bytes;
    const void *const toy = toy_model_blob(&bytes);
    toy_written(model, toy, bytes);
    toy_segments_fill(&made, 1, 0);
    toy_written(segments, blob, toy_segments_write(blob, &made));
    test_every_allocation();
    test_files();
    test_threads();
    unlink(model);
    unlink(segments);
    return CHECK_DONE();
}
