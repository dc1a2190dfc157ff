/* Keypoints to 3-D in the daemon: a model without a segment prior, cameras, unknown names, times that do not advance. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "gait_lift.h"

static bool fails;

/* The library's estimate, or one out of range. */
static gait_result layer_estimate(gait_lift *lift, gait_lift_frame *frame, gait_error *err)
{
    gait_result const s = gait_lift_estimate(lift, frame, err);
    if (fails)
        snprintf(err->text, sizeof err->text, "observations are out of range");
    return fails ? GAIT_ERR_NUMERIC : s;
}

#define gait_lift_estimate layer_estimate
#include "../../tools/trackd/lift_service.c"
#undef gait_lift_estimate
#include "gaitmsg_tracks_t.h"

#include "check.h"
#include "toy_model.h"
#include "toy_segment.h"
#include "toy_written.h"

enum { FRAME = 40000 };

static const gait_camera CAMERA = {48, 32, 50, 50, 24, 16, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};
static const lift_settings SET = {.sd = 3, .lag = 2, .cpu_mask = ~0u};

static char segments[] = P_tmpdir "/gait_lift_XXXXXX";
static lift_service l;
static sink out;
static message why;

/* Keypoints of a frame: those of the model, or this one alone. */
static bool keypoints(int64_t utime, const char *name, float u)
{
    static uint8_t bytes[4096];
    gaitmsg_track_t k[TOY_MARKERS];
    gaitmsg_tracks_t m = {.utime = utime, .frame = 7, .ntracks = name ? 1 : TOY_MARKERS, .tracks = k};
    keypoints_view v;
    memset(k, 0, sizeof k);
    for (int i = 0; i < m.ntracks; i++) {
        k[i].name = (char *)(uintptr_t)(name ? name : gait_lift_marker_name(l.lift, i));
        k[i].u = u + (float)(i % 7);
        k[i].v = 8.0f + (float)(i % 13);
        k[i].confidence = 1.0f;
    }
    int const size = gaitmsg_tracks_t_encode(bytes, 0, sizeof bytes, &m);
    why.text[0] = '\0';
    return size > 0 && keypoints_view_open(&v, bytes, (size_t)size, &why) &&
           lift_service_keypoints(&l, &v, utime, &why);
}

static void test_open(void)
{
    char toy[] = P_tmpdir "/gait_lift_XXXXXX";
    size_t bytes;
    const void *const model = toy_model_blob(&bytes);
    lift_settings const usual = {.sd = 0, .lag = -1, .cpu_mask = ~0u};
    toy_written(toy, model, bytes);
    l = (lift_service){0};
    CHECK(!lift_service_open(&l, "/absent/model", &SET, &out, &why) && strstr(why.text, "cannot open"));
    lift_service_close(&l);
    CHECK(!lift_service_open(&l, toy, &SET, &out, &why) && strstr(why.text, "--lift: ") && !l.memory);
    lift_service_close(&l);
    gait_lift_config c;
    gait_lift_default(&c);
    CHECK(lift_service_open(&l, segments, &usual, &out, &why) && l.config.sd == c.sd &&
          l.config.lag == c.lag);
    lift_service_close(&l);
    CHECK(lift_service_open(&l, segments, &SET, &out, &why) && l.config.sd == 3.0 && l.config.lag == 2);
    unlink(toy);
}

static void test_camera(void)
{
    gait_camera bad = CAMERA;
    bad.fx = NAN;
    CHECK(!lift_service_camera(&l, &bad, &why) && strstr(why.text, "--lift: ") && !l.lift);
    CHECK(lift_service_camera(&l, &CAMERA, &why) && l.lift);
}

static void test_times(void)
{
    for (int i = 0; i < 3; i++)
        CHECK(keypoints(2000000 + i * FRAME, NULL, 24));
    CHECK(l.frames == 3 && l.lifted >= 1 && l.rejected == 0 && l.step.count == 3);
    CHECK(!keypoints(2000000 + 2 * FRAME, NULL, 24) && strstr(why.text, "capture time did not advance"));
    CHECK(!keypoints(2000000, NULL, 24) && l.rejected == 2 && !keypoints(-1, NULL, 24));
    for (int back = 0; back < 2; back++) { /* a clock that is set back begins anew, and is reported once */
        CHECK(keypoints(500000, NULL, 24) && l.reported_back && l.last == 500000 && l.rejected == 2);
        CHECK(keypoints(2000000, NULL, 24));
    }
}

static void test_names(void)
{
    int64_t const rejected = l.rejected;
    CHECK(!keypoints(9000000, "nose", 24) && strstr(why.text, "knows none of these keypoints"));
    CHECK(keypoints(9000000 + FRAME, gait_lift_marker_name(l.lift, 1), 24)); /* one is enough */
    CHECK(l.rejected == rejected + 1 && l.last == 9000000 + FRAME);
}

/* An estimate out of range is refused and counted; the next frames begin anew. */
static void test_out_of_range(void)
{
    int64_t const rejected = l.rejected, lifted = l.lifted;
    CHECK(keypoints(15000000, NULL, 24) && keypoints(15000000 + FRAME, NULL, 24));
    fails = true;
    CHECK(!keypoints(15000000 + 2 * FRAME, NULL, 24) && l.rejected == rejected + 1);
    CHECK(strcmp(why.text, "keypoints: observations are out of range; the lift restarts") == 0);
    fails = false;
    CHECK(keypoints(15000000 + 3 * FRAME, NULL, 24) && l.rejected == rejected + 1 && l.lifted == lifted);
    CHECK(keypoints(15000000 + 4 * FRAME, NULL, 24) && keypoints(15000000 + 5 * FRAME, NULL, 24) &&
          l.lifted > lifted);
}

/* Any estimate that is sent is finite. */
static void test_absurd(void)
{
    int64_t utime = 20000000;
    for (float u = 1e4f; u < 1e38f; u *= 1e4f, utime += FRAME) {
        bool const ok = keypoints(utime, NULL, u);
        CHECK(ok || why.text[0]);
        for (int32_t i = 0; ok && i < 3 * l.info.markers && l.estimate.status != GAIT_TRACK_INIT; i++)
            CHECK(isfinite(l.estimate.marker[i / 3][i % 3]));
    }
}

int main(void)
{
    static uint8_t blob[TOY_BYTES];
    static toy_segments made;
    toy_segments_fill(&made, 1, 0);
    toy_written(segments, blob, toy_segments_write(blob, &made));
    test_open();
    l.lift = NULL;
    CHECK(keypoints(1, "nose", 24) && l.frames == 0); /* no camera yet */
    test_camera();
    test_times();
    test_names();
    test_out_of_range();
    test_absurd();
    lift_service_close(&l);
    unlink(segments);
    return CHECK_DONE();
}
