/* Which announced camera gait-trackd uses: the rule for one stream, and a service with a further camera. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "../../tools/trackd/common.h"
#include "../../tools/trackd/service.h"

#include "check.h"
#include "toy_camera_message.h"
#include "toy_model.h"
#include "toy_written.h"

static const gait_camera CAMERA = {48, 32, 50, 50, 24, 16, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1, 5}, {0}};

static gait_camera wider(float fx)
{
    gait_camera c = CAMERA;
    c.fx = fx;
    return c;
}

/* Time is that of arrival: whatever a sender states, it has to be the only one for ten seconds. */
static void test_slot(void)
{
    gait_camera const other = wider(60), third = wider(70);
    camera_slot slot = {0};
    CHECK(camera_announced(&slot, &CAMERA, 5) == CAMERA_NEW && slot.known);
    CHECK(camera_announced(&slot, &CAMERA, 6) == CAMERA_SAME);
    CHECK(camera_announced(&slot, &other, 7) == CAMERA_REFUSED);
    CHECK(camera_announced(&slot, &other, 6 + CAMERA_SILENT) == CAMERA_REFUSED);
    CHECK(camera_announced(&slot, &CAMERA, 6 + CAMERA_SILENT) == CAMERA_SAME); /* the real one: begin again */
    CHECK(camera_announced(&slot, &other, 7 + CAMERA_SILENT) == CAMERA_REFUSED);
    CHECK(camera_announced(&slot, &third, 8 + CAMERA_SILENT) == CAMERA_REFUSED); /* not alone */
    CHECK(camera_announced(&slot, &other, 9 + CAMERA_SILENT) == CAMERA_REFUSED);
    CHECK(camera_announced(&slot, &other, 8 + 2 * CAMERA_SILENT) == CAMERA_REFUSED);
    CHECK(camera_announced(&slot, &other, 9 + 2 * CAMERA_SILENT) == CAMERA_NEW);
    CHECK(camera_same(&slot.camera, &other));
    slot.fixed = true;
    CHECK(camera_announced(&slot, &CAMERA, 1) == CAMERA_REFUSED);
    CHECK(camera_announced(&slot, &CAMERA, INT64_MAX) == CAMERA_REFUSED);
}

/* A camera from a snapshot gives way at once, until it has been announced. */
static void test_provisional(void)
{
    gait_camera const other = wider(60);
    camera_slot slot = {0};
    camera_use(&slot, &CAMERA);
    slot.provisional = true;
    CHECK(camera_announced(&slot, &other, 1) == CAMERA_NEW && !slot.provisional);
    slot.provisional = true;
    CHECK(camera_announced(&slot, &other, 2) == CAMERA_SAME);
    CHECK(camera_announced(&slot, &CAMERA, 3) == CAMERA_REFUSED);
}

/* An older time of arrival, of a log that is damaged, begins the ten seconds anew. */
static void test_arrival(void)
{
    gait_camera const other = wider(60);
    camera_slot slot = {0};
    CHECK(camera_announced(&slot, &CAMERA, CAMERA_SILENT) == CAMERA_NEW);
    CHECK(camera_announced(&slot, &other, CAMERA_SILENT) == CAMERA_REFUSED);
    CHECK(camera_announced(&slot, &other, 7) == CAMERA_REFUSED && slot.other_since == 7);
    CHECK(camera_announced(&slot, &other, 6 + CAMERA_SILENT) == CAMERA_REFUSED);
    CHECK(camera_announced(&slot, &other, 7 + CAMERA_SILENT) == CAMERA_NEW);
}

/* ---- what a camera has to be ---- */
static void test_check(void)
{
    static const struct {
        int32_t width, height;
        float fx, fy, cx, cy;
        const char *reason;
    } bad[] = {
        {0, 32, 50, 50, 24, 16, "size of 0x32"},
        {48, 0, 50, 50, 24, 16, "size of 48x0"},
        {GAIT_MAX_PIXELS + 1, 32, 50, 50, 24, 16, "send 1 to"},
        {48, GAIT_MAX_PIXELS + 1, 50, 50, 24, 16, "send 1 to"},
        {48, 33, 50, 50, 24, 16, "more than the 1536 that --max-pixels leaves"},
        {48, 32, 0, 50, 24, 16, "focal lengths 0 and 50"},
        {48, 32, 50, NAN, 24, 16, "focal lengths 50 and nan"},
        {48, 32, 1e-30f, 50, 24, 16, "focal lengths 1e-30 and 50"},
        {48, 32, 50, 50, 3e38f, 16, "principal point (3e+38, 16) is not near the middle of 48x32 pixels"},
        {48, 32, 50, 50, NAN, 16, "principal point"},
        {48, 32, 50, 50, 24, -INFINITY, "principal point"},
        {48, 32, 50, 50, 6.6f, 16, "principal point"},
        {48, 32, 50, 50, 24, 26.8f, "principal point"},
        {48, 32, 50, 50, 11.5f, 7.5f, "principal point (11.5, 7.5) is not near"}, /* of 24x16 */
        {48, 32, 50, 50, 29.1f, 19.3f, "principal point"},                        /* of 59x40 */
    };
    message why;
    gait_camera c = CAMERA, out;
    CHECK(camera_check(&c, 48 * 32, &why));
    c.cx = 6.8f, c.cy = 26.6f; /* 35 % off the middle */
    CHECK(camera_check(&c, 48 * 32, &why));
    c.cx = 28.1f, c.cy = 18.6f; /* on both axes alike, but less than 10 % */
    CHECK(camera_check(&c, 48 * 32, &why));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        c = CAMERA;
        c.width = bad[i].width, c.height = bad[i].height, c.fx = bad[i].fx, c.fy = bad[i].fy;
        c.cx = bad[i].cx, c.cy = bad[i].cy;
        CHECK(!camera_check(&c, 48 * 32, &why) && strstr(why.text, bad[i].reason));
    }
    c = CAMERA;
    c.t[1] = 3e38f;
    CHECK(!camera_check(&c, 48 * 32, &why) && strstr(why.text, "send metres, within 10 km"));
    c = CAMERA;
    c.distortion[4] = NAN;
    CHECK(!camera_check(&c, 48 * 32, &why) && strstr(why.text, "distortion outside"));
    for (int i = 0; i < 9; i++) { /* another number anywhere, or a left-handed system */
        c = CAMERA;
        c.R[i] = c.R[i] == 0.0f ? 0.1f : -c.R[i];
        CHECK(!camera_check(&c, 48 * 32, &why) && strstr(why.text, "R is not a rotation"));
        gaitmsg_camera_t const msg = {
            .width = 48, .height = 32, .fx = 50, .fy = 50, .cx = 24, .cy = 16, .R = {1, 2}};
        CHECK(!camera_from_message(&msg, 48 * 32, &out, &why) && strstr(why.text, "R is not a rotation"));
    }
}

static void test_same(void)
{
    gait_camera c = CAMERA;
    CHECK(camera_same(&c, &CAMERA));
    c.t[2] *= 1.000001f; /* rounding */
    CHECK(camera_same(&c, &CAMERA));
    c = CAMERA;
    c.distortion[4] = 1e-3f;
    CHECK(!camera_same(&c, &CAMERA));
    c = CAMERA;
    c.width++;
    CHECK(!camera_same(&c, &CAMERA));
    c = CAMERA;
    c.height++;
    CHECK(!camera_same(&c, &CAMERA));
}

/* ---- files ---- */
#define BEGIN  "{\"width\": 48, \"height\": 32, \"fx\": 50, \"fy\": 50, \"cx\": 24, \"cy\": 16, "
#define TURNED "\"R\": [1, 0, 0, 0, 0, -1, 0, 1, 0], "

static bool file(const char *text, gait_camera *out, message *why)
{
    char name[] = P_tmpdir "/gait_cameras_XXXXXX";
    toy_written(name, text, strlen(text));
    bool const ok = camera_file_read(name, out, why);
    CHECK(ok || strncmp(why->text, name, strlen(name)) == 0);
    unlink(name);
    return ok;
}

static void test_files(void)
{
    static const char *const good[] = {
        BEGIN TURNED "\"t\": [0, 1, 5]}",
        BEGIN TURNED "\"t\": [0, 1, 5], \"distortion\": [], \"note\": {\"any\": [1]}}",
        BEGIN TURNED "\"t\": [0, 1, 5], \"distortion\": [0, 0, 0, 0]}",
        BEGIN "\"R\": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], \"t\": [0, 1, 5], \"distortion\": [0, 0, 0, 0, 0]}",
    };
    static const struct {
        const char *text, *reason;
    } bad[] = {
        {"{\"width\": 4.5}", "width is 4.5, not a whole number"},
        {"{\"width\": 48}", "height is missing; give the size of the video"},
        {"{\"width\": 48, \"height\": 32}", "fx is missing; give the focal length"},
        {"{\"width\": 48, \"height\": 32, \"fx\": 50}", "fy is missing; give the focal length"},
        {"{\"width\": 48, \"height\": 32, \"fx\": 50, \"fy\": 50}",
         "cx is missing; give the principal point"},
        {"{\"width\": 48, \"height\": 32, \"fx\": 50, \"fy\": 50, \"cx\": 2}", "cy is missing"},
        {BEGIN "\"t\": [0, 1, 5]}", "R is missing; give the rotation"},
        {BEGIN TURNED "\"t\": [0, 1]}", "t has 2 numbers, not 3"},
        {BEGIN TURNED "\"t\": [0, 1, 5], \"distortion\": [0, 0]}", "distortion is not such a list"},
        {BEGIN TURNED "\"t\": [0, 1, 5], \"distortion\": \"no\"}", "distortion is not such a list"},
        {BEGIN TURNED "\"t\": [0, 1, 5], \"distortion\": [0, 0, 0, 1e9]}", "outside [-1000, 1000]"},
        {BEGIN "\"R\": [1, 0, 0, 0, 1, 0, 0, 0, -1], \"t\": [0, 1, 5]}", "R is not a rotation"},
        {BEGIN TURNED "\"t\": [0, -1, 5]}", ": "}, /* below the ground */
        {BEGIN TURNED "\"t\": [0, 1, NaN]}", "t is not finite"},
        {BEGIN TURNED "\"t\": [0, 1, 5], \"focus\": 1}", "focus is not a known key"},
        {BEGIN TURNED "\"t\": [0, 1, 5], \"t\": [0, 1, 5]}", "t is given twice"},
        {"[1]", "not a JSON object"},
        {"{", "not valid JSON (line 1: "},
    };
    gait_camera out;
    message why;
    for (size_t i = 0; i < sizeof good / sizeof *good; i++)
        CHECK(file(good[i], &out, &why) && camera_same(&out, &CAMERA));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK(!file(bad[i].text, &out, &why) && strstr(why.text, bad[i].reason));
    CHECK(!camera_file_read("shop.toml:door", &out, &why) && strstr(why.text, "reads JSON only"));
    CHECK(!camera_file_read("folder/cams.pkl", &out, &why) && strstr(why.text, "reads JSON only"));
    CHECK(!camera_file_read("absent.toml/camera", &out, &why) && strstr(why.text, "cannot open"));
}

/* ---- a service with a further camera ---- */
static service_shared shared;
static service s = {.shared = &shared};
static further more;

static void start(void)
{
    static sink out;
    char name[] = P_tmpdir "/gait_cameras_XXXXXX";
    gait_tracker_config config;
    size_t bytes;
    message why;
    const void *const toy = toy_model_blob(&bytes);
    toy_written(name, toy, bytes);
    gait_tracker_default(&config, GAIT_MODE_DEFAULT);
    config.particles = config.acquisition_particles = 16;
    if (!tracking_open(&s.track, name, &config, &why) || !further_open(&more, "1,2", 0, &why))
        abort();
    unlink(name);
    shared.out = &out;
    shared.further = &more;
    shared.max_pixels = 3 * 48 * 32;
    if (!service_open(&s, NULL, false, &why))
        abort();
}

static void announce(further_camera *c, const gait_camera *camera, int64_t arrival)
{
    gaitmsg_camera_t const msg = toy_camera_message(camera, 0);
    service_camera(&s, c, &msg, arrival);
}

static void test_further(void)
{
    gait_camera const other = wider(60);
    gait_camera big = CAMERA;
    big.height++;
    announce(&more.camera[0], &other, 1);
    announce(NULL, &CAMERA, 1);
    announce(&more.camera[1], &big, 1); /* the pictures of all together are too many */
    CHECK(!s.track.tracker && !more.camera[1].slot.known);
    CHECK(strstr(s.text.text, "48x33 pixels, more than the 1536 that --max-pixels leaves") != NULL);
    announce(&more.camera[1], &CAMERA, 1);
    CHECK(s.track.tracker && s.track.config.cameras == 3 && s.state == GAITMSG_STATUS_T_READY);
    size_t const bytes = s.track.memory_bytes;
    CHECK(bytes == s.track.model_bytes + s.track.tracker_bytes + s.track.picture_bytes +
                       shared.hold.capacity + more.camera[0].bytes + more.camera[1].bytes);
    s.state = GAITMSG_STATUS_T_RUNNING;
    announce(&more.camera[0], &CAMERA, 2);
    CHECK(s.state == GAITMSG_STATUS_T_RUNNING && strstr(s.text.text, "after 10 seconds"));
    announce(&more.camera[0], &CAMERA, 2 + CAMERA_SILENT);
    CHECK(s.track.tracker && s.state == GAITMSG_STATUS_T_READY && s.track.memory_bytes == bytes);
    CHECK(camera_same(&s.track.config.camera[1], &CAMERA));
}

int main(void)
{
    test_slot();
    test_provisional();
    test_arrival();
    test_check();
    test_same();
    test_files();
    start();
    test_further();
    service_close(&s);
    service_shared_close(&shared);
    further_close(&more);
    return CHECK_DONE();
}
