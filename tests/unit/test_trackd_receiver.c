/* Messages by channel: subscriptions that fail, whose messages are whose, connections that end. */
#define _GNU_SOURCE /* ppoll, P_tmpdir */

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include "../../tools/trackd/lcm_link.h"
#include "../../tools/trackd/receiver.h"

/* The layer under receiver.c: connections that only count. */
static struct layer {
    int opened, closed, subscribed, fail_open,
        fail_subscribe;    /* fail_*: the number of the call that fails, 0: none */
    char channels[2048];   /* each with a space behind it */
    int ready[2], left[2]; /* of images and of others: result of lcm_handle_timeout(), for so many calls */
    int poll;              /* result of ppoll() */
    int waits;             /* number of calls until the program shall end */
} layer;

static lcm_t *const CONNECTION[2] = {(lcm_t *)&layer.ready[0], (lcm_t *)&layer.ready[1]};
static volatile sig_atomic_t ended;

static lcm_t *layer_open(const char *url, message *why)
{
    if (++layer.opened == layer.fail_open)
        message_set(why, "%s: cannot be opened", url);
    return layer.opened == layer.fail_open ? NULL : CONNECTION[layer.opened - 1];
}

static lcm_subscription_t *layer_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t fn, void *user,
                                           int capacity, message *why)
{
    if (++layer.subscribed == layer.fail_subscribe || !lcm || !fn || !user || capacity < 1) {
        message_set(why, "cannot receive %s", channel);
        return NULL;
    }
    strcat(strcat(layer.channels, channel), " ");
    return (lcm_subscription_t *)&layer;
}

static void layer_destroy(lcm_t *lcm)
{
    layer.closed += lcm == CONNECTION[0] || lcm == CONNECTION[1];
}

static int layer_handle(lcm_t *lcm, int timeout)
{
    int const which = lcm == CONNECTION[1];
    return timeout == 0 && layer.left[which]-- > 0 ? layer.ready[which] : 0;
}

static int layer_fileno(lcm_t *lcm)
{
    return lcm ? -1 : 0;
}

static int layer_queue(lcm_subscription_t *s)
{
    return s ? 0 : -1;
}

static int layer_poll(struct pollfd *fd, nfds_t count, const struct timespec *wait, const sigset_t *mask)
{
    ended = --layer.waits <= 0 || !fd || !count || !wait || !mask;
    errno = layer.poll < 0 ? -layer.poll : 0;
    return layer.poll < 0 ? -1 : layer.poll;
}

#undef lcm_destroy
#undef lcm_handle_timeout
#undef lcm_get_fileno
#undef lcm_subscription_get_queue_size
#define link_open                       layer_open
#define link_subscribe                  layer_subscribe
#define lcm_destroy                     layer_destroy
#define lcm_handle_timeout              layer_handle
#define lcm_get_fileno                  layer_fileno
#define lcm_subscription_get_queue_size layer_queue
#define ppoll                           layer_poll
#include "../../tools/trackd/receiver.c"

#include "check.h"
#include "toy_model.h"
#include "toy_written.h"

static char model[] = P_tmpdir "/gait_receiver_XXXXXX";
static service_shared shared;
static service s = {.shared = &shared}, second;
static keypoint_cue cue, second_cue;
static further more;
static snapshot_file snapshot;
static sink out;
static receiver r;
static message why;

/* Two people and a further camera. */
static void start(void)
{
    gait_tracker_config config;
    gait_tracker_default(&config, GAIT_MODE_DEFAULT);
    config.particles = config.acquisition_particles = 16;
    shared.out = &out;
    shared.max_pixels = 48 * 32;
    s.person = 1;
    shared.further = &more;
    s.cue = &cue;
    if (!tracking_open(&s.track, model, &config, &why) || !further_open(&more, "3", 0, &why) ||
        !service_open(&s, NULL, false, &why))
        abort();
    keypoint_cue_open(&cue, s.track.model, s.track.info.joints, 4);
    keypoint_cue_open(&second_cue, s.track.model, s.track.info.joints, 4);
    service_share(&second, &s, 2, &second_cue);
    if (!service_open(&second, NULL, false, &why))
        abort();
}

static const char LIVE[] =
    "GAIT_IMAGE_0 GAIT_CAMERA_3 GAIT_BACKGROUND_3 GAIT_IMAGE_3 GAIT_CAMERA_0 GAIT_BACKGROUND_0 "
    "GAIT_TRACKS_0_1 GAIT_COMMAND_1 GAIT_STATUS_1 GAIT_TRACKS_0_2 GAIT_COMMAND_2 "
    "GAIT_STATUS_2 ";

static void test_open(void)
{
    layer = (struct layer){0};
    CHECK(receiver_open(&r, &s, &snapshot, "udpm://239.1.1.1:7667", &why) &&
          strcmp(layer.channels, LIVE) == 0);
    int const all = layer.subscribed;
    receiver_close(&r);
    CHECK(layer.opened == 2 && layer.closed == 2);
    for (int k = 1; k <= all; k++) {
        layer = (struct layer){.fail_subscribe = k};
        CHECK(!receiver_open(&r, &s, &snapshot, "udpm://239.1.1.1:7667", &why));
        CHECK(strstr(why.text, "cannot receive GAIT_") && layer.subscribed == k);
        receiver_close(&r);
        CHECK(layer.closed == 2);
    }
    for (int k = 1; k <= 2; k++) {
        layer = (struct layer){.fail_open = k};
        CHECK(!receiver_open(&r, &s, &snapshot, "udpm://239.1.1.1:7667", &why) && layer.subscribed == 0);
        receiver_close(&r);
        CHECK(layer.closed == k - 1);
    }
    /* A log is one connection, in which the statuses of other daemons mean nothing. */
    layer = (struct layer){0};
    CHECK(receiver_open(&r, &s, &snapshot, "file:///log", &why) && layer.opened == 1);
    CHECK(!strstr(layer.channels, "GAIT_STATUS"));
    receiver_close(&r);
    CHECK(layer.closed == 1);
}

static bool run(bool log, struct layer how)
{
    sigset_t none;
    sigemptyset(&none);
    ended = 0;
    why.text[0] = '\0';
    layer = (struct layer){0};
    if (!receiver_open(&r, &s, &snapshot, log ? "file:///log" : "udpm://239.1.1.1:7667", &why))
        abort();
    layer = how;
    bool const ok = receiver_run(&r, &ended, &none, &why);
    receiver_close(&r);
    return ok;
}

static void test_run(void)
{
    CHECK(run(false, (struct layer){.waits = 3}) && ended && layer.waits == 0);
    CHECK(run(false, (struct layer){.waits = 3, .poll = -EINTR}) && ended);
    CHECK(!run(false, (struct layer){.waits = 3, .poll = -EBADF}) &&
          strstr(why.text, "cannot wait for messages"));
    CHECK(run(false, (struct layer){.waits = 2, .poll = 1, .ready = {1, 1}, .left = {9, 5}}));
    CHECK(layer.left[1] < 0 && layer.left[0] == 7); /* all others before one image */
    CHECK(!run(false, (struct layer){.waits = 3, .poll = 1, .ready = {-1, 0}, .left = {1, 0}}));
    CHECK(strstr(why.text, "the LCM connection has failed") && !ended);
    CHECK(!run(false, (struct layer){.waits = 3, .poll = 1, .ready = {0, -1}, .left = {0, 1}}));
    CHECK(run(true, (struct layer){.waits = 3, .poll = 1, .ready = {-1, 0}, .left = {1, 0}}) && !ended);
    out.log = (lcm_eventlog_t *)&layer; /* an output that has failed ends the program */
    out.failed = 1;
    message_set(&out.fault, "disk full");
    s.news = second.news = false;
    CHECK(!run(true, (struct layer){.waits = 9}) && strstr(why.text, "disk full") && layer.waits == 8);
    out = (sink){0};
}

/* ---- whose messages are whose ---- */
static lcm_recv_buf_t buffer(uint8_t *bytes, int size)
{
    return (lcm_recv_buf_t){.data = bytes, .data_size = (uint32_t)size, .recv_utime = 5};
}

static void test_channels(void)
{
    static uint8_t bytes[4096];
    layer = (struct layer){0};
    if (!receiver_open(&r, &s, &snapshot, "udpm://239.1.1.1:7667", &why))
        abort();
    CHECK(service_of(&r, "GAIT_COMMAND_2") == &second && service_of(&r, "GAIT_COMMAND_1") == &s);
    CHECK(service_of(&r, "GAIT_COMMAND_9") == &s && service_of(&r, "other") == &s);
    gaitmsg_command_t const stop = {.command = GAITMSG_COMMAND_T_STOP, .id = 9};
    lcm_recv_buf_t b = buffer(bytes, gaitmsg_command_t_encode(bytes, 0, sizeof bytes, &stop));
    second.seek = s.seek = true;
    on_command(&b, "GAIT_COMMAND_2", &r);
    CHECK(!second.seek && s.seek && second.command_id == 9 && s.command_id == 0);
    b.data_size--;
    on_command(&b, "GAIT_COMMAND_2", &r);
    CHECK(strstr(second.text.text, "GAIT_COMMAND_2: damaged message or another version of its type"));
    on_status(&b, "GAIT_STATUS_1", &r); /* of another type: not one of ours */
    on_status(&(lcm_recv_buf_t){.data = bytes, .data_size = 3}, "GAIT_STATUS_1", &r);
    CHECK(!strstr(s.text.text, "another gait-trackd"));
    gaitmsg_status_t const theirs = {
        .utime = 77, .version = (char *)(uintptr_t)"", .text = (char *)(uintptr_t)""};
    b = buffer(bytes, gaitmsg_status_t_encode(bytes, 0, sizeof bytes, &theirs));
    on_status(&b, "GAIT_STATUS_1", &r);
    CHECK(strstr(s.text.text, "another gait-trackd uses this URL"));
    static const struct {
        lcm_msg_handler_t handler;
        const char *channel;
    } images[] = {{on_frame, "GAIT_IMAGE_0"},
                  {on_background, "GAIT_BACKGROUND_0"},
                  {on_further_frame, "GAIT_IMAGE_3"},
                  {on_further_background, "GAIT_BACKGROUND_3"},
                  {on_keypoints, "GAIT_TRACKS_0_1"}};
    for (size_t i = 0; i < sizeof images / sizeof *images; i++) { /* a status is none of these */
        int64_t const rejected = s.counts.rejected;
        images[i].handler(&b, images[i].channel, &r);
        CHECK(strncmp(s.text.text, images[i].channel, strlen(images[i].channel)) == 0);
        CHECK(s.counts.rejected == rejected + (images[i].handler != on_keypoints));
    }
    receiver_close(&r);
}

int main(void)
{
    size_t bytes;
    const void *const toy = toy_model_blob(&bytes);
    toy_written(model, toy, bytes);
    start();
    test_open();
    test_run();
    test_channels();
    service_close(&second);
    service_close(&s);
    service_shared_close(&shared);
    further_close(&more);
    unlink(model);
    return CHECK_DONE();
}
