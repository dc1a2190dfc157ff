/* Which announced camera gait-trackd uses: the rule for one stream, and a service with a further camera. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "../../tools/trackd/common.h"
#include "../../tools/trackd/service.h"

#include "check.h"
#include "toy_model.h"

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

/* ---- a service with a further camera ---- */
static service s;
static further more;

static void start(void)
{
    static sink out;
    char name[] = P_tmpdir "/gait_cameras_XXXXXX";
    gait_tracker_config config;
    size_t bytes;
    message why;
    const void *const toy = toy_model_blob(&bytes);
    int const file = mkstemp(name);
    gait_tracker_default(&config, GAIT_MODE_DEFAULT);
    config.particles = config.acquisition_particles = 16;
    if (write(file, toy, bytes) != (ssize_t)bytes || !tracking_open(&s.track, name, &config, &why) ||
        !further_open(&more, "1,2", 0, &why))
        abort();
    close(file);
    unlink(name);
    s.further = &more;
    s.max_pixels = 3 * 48 * 32;
    if (!service_open(&s, &out, 0, 1, NULL, false, &why))
        abort();
}

static void announce(further_camera *c, const gait_camera *camera, int64_t arrival)
{
    gaitmsg_camera_t msg = {.width = camera->width,
                            .height = camera->height,
                            .fx = (double)camera->fx,
                            .fy = (double)camera->fy,
                            .cx = (double)camera->cx,
                            .cy = (double)camera->cy};
    for (int i = 0; i < 9; i++)
        msg.R[i] = (double)camera->R[i];
    for (int i = 0; i < 3; i++)
        msg.t[i] = (double)camera->t[i];
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
    CHECK(bytes == s.track.model_bytes + s.track.tracker_bytes + s.track.picture_bytes + s.hold.capacity +
                       more.camera[0].bytes + more.camera[1].bytes);
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
    start();
    test_further();
    service_close(&s);
    further_close(&more);
    return CHECK_DONE();
}
