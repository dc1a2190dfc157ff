/* The service without a transport: commands, frames, pauses, backgrounds, a moving camera, several people, and what is reported
 * about each. */
#define _XOPEN_SOURCE 700 /* P_tmpdir */
#include <stdlib.h>
#include <unistd.h>

#include "../../tools/trackd/service.h"
#include "gaitmsg_image_t.h"

#include "check.h"
#include "toy_camera_message.h"
#include "toy_model.h"
#include "toy_written.h"

enum { WIDTH = 48, HEIGHT = 32, FRAME = 33333 };

static const gait_camera CAMERA = {WIDTH,     HEIGHT, 50, 50, 24, 16, {1, 0, 0, 0, 0, -1, 0, 1, 0},
                                   {0, 1, 5}, {0}};

static char model[] = P_tmpdir "/gait_service_XXXXXX";
static uint8_t pixels[3 * WIDTH * HEIGHT], other[3 * WIDTH * HEIGHT];
static service s, second, third;
static service_shared shared;
static keypoint_cue cue[3];
static pose_path path;
static further more;

/* A service, with these parts if they are not NULL, that has no camera yet. */
static void begin(pose_path *with_path, further *with_further, bool people)
{
    static sink out;
    gait_tracker_config config;
    message why;
    gait_tracker_default(&config, GAIT_MODE_DEFAULT);
    config.particles = config.acquisition_particles = 16;
    s = second = third = (service){.shared = &shared};
    shared = (service_shared){.out = &out, .threads = 1};
    path = (pose_path){.turn_sd = 0.01f, .place_sd = 0.01f};
    shared.max_pixels = 2 * WIDTH * HEIGHT;
    shared.max_gap = 2;
    shared.path = with_path;
    shared.further = with_further;
    bool ok = tracking_open(&s.track, model, &config, &why) && further_open(&more, "1", 0, &why);
    for (int i = 0; i < 3 && people; i++)
        keypoint_cue_open(&cue[i], s.track.model, s.track.info.joints, 4);
    s.cue = people ? &cue[0] : NULL;
    s.person = people;
    ok = ok && service_open(&s, NULL, false, &why);
    if (people) {
        service_share(&second, &s, 2, &cue[1]);
        service_share(&third, &s, 3, &cue[2]);
        ok = ok && service_open(&second, NULL, false, &why) && service_open(&third, NULL, false, &why);
    }
    if (!ok)
        abort();
}

static void end(void)
{
    if (s.next) {
        service_close(&third);
        service_close(&second);
    }
    service_close(&s);
    service_shared_close(&shared);
    further_close(&more);
}

static void announce(further_camera *c, const gait_camera *camera, int64_t utime)
{
    gaitmsg_camera_t const msg = toy_camera_message(camera, utime);
    service_camera(&s, c, &msg, utime);
}

static image_view view(int64_t utime, int64_t frame)
{
    return (image_view){.utime = utime,
                        .frame = frame,
                        .width = WIDTH,
                        .height = HEIGHT,
                        .stride = WIDTH,
                        .pixelformat = GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY,
                        .size = WIDTH * HEIGHT,
                        .data = pixels};
}

static void frame(int64_t utime, int64_t number)
{
    image_view const v = view(utime, number);
    service_frame(&s, &v, true, utime);
}

static gaitmsg_command_t start_command(int64_t utime)
{
    gait_state const *const mean = &s.track.prior_mean, *const sd = &s.track.prior_sd;
    gaitmsg_command_t c = {.utime = utime, .command = GAITMSG_COMMAND_T_START};
    convert_state(mean, &s.track.info, &c.mean);
    convert_state(sd, &s.track.info, &c.sd);
    return c;
}

static void start(service *of, int64_t utime)
{
    gaitmsg_command_t const c = start_command(utime);
    service_command(of, &c);
}

static bool text(const char *part)
{
    return strstr(s.text.text, part) != NULL;
}

static bool lacks(const char *part)
{
    message why;
    s.complaint.text[0] = '\0';
    service_lack(&s, &why);
    return strstr(why.text, part) != NULL;
}

/* ---- commands ---- */
static void test_commands(void)
{
    begin(NULL, NULL, false);
    CHECK(s.state == GAITMSG_STATUS_T_WAITING && service_digest(&s) == 0);
    announce(NULL, &CAMERA, 1);
    CHECK(s.state == GAITMSG_STATUS_T_READY && service_digest(&s) != 0);
    static const struct {
        int32_t ncoef, noffset;
        int64_t utime;
        float stature;
        const char *reason;
    } bad[] = {
        {-1, 0, 1, 1.7f, "ncoef -1; give 0 to"},     {GAIT_MAX_COMPONENTS + 1, 0, 1, 1.7f, "ncoef"},
        {0, -1, 1, 1.7f, "noffset -1; give 0 to"},   {0, GAIT_MAX_ANGLES + 1, 1, 1.7f, "noffset"},
        {0, 0, -1, 1.7f, "time -1 is out of range"}, {0, 0, 1, 99, "send another START"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        gaitmsg_command_t c = start_command(bad[i].utime);
        c.mean.ncoef = bad[i].ncoef;
        c.mean.noffset = bad[i].noffset;
        c.mean.stature = bad[i].stature;
        service_command(&s, &c);
        CHECK(s.state == GAITMSG_STATUS_T_READY && text(bad[i].reason));
    }
    gaitmsg_command_t c = start_command(1);
    c.sd.ncoef = -1;
    service_command(&s, &c);
    CHECK(s.state == GAITMSG_STATUS_T_READY && text("ncoef -1"));
    c = (gaitmsg_command_t){.command = 77, .id = 5};
    service_command(&s, &c);
    CHECK(text("unknown command 77") && s.command_id == 5);
    c.command = GAITMSG_COMMAND_T_STOP;
    s.seek = true;
    service_command(&s, &c); /* the same number: repeated */
    CHECK(s.seek);
    c.id = 0;
    service_command(&s, &c);
    CHECK(!s.seek && text("waiting for START"));
    start(&s, 100);
    CHECK(s.state == GAITMSG_STATUS_T_ARMED && s.seek);
    CHECK(s.start.sd.turn_rate > 0.0f && s.start.sd.turn_rate == s.track.prior_sd.turn_rate);
    c.command = GAITMSG_COMMAND_T_RESET;
    service_command(&s, &c);
    CHECK(s.state == GAITMSG_STATUS_T_READY && text("waiting for the background"));
    end();
}

/* ---- frames ---- */
static void test_frames(void)
{
    begin(NULL, NULL, false);
    announce(NULL, &CAMERA, 1);
    start(&s, 1000000);
    frame(1000000 - FRAME, 3);
    CHECK(s.state == GAITMSG_STATUS_T_ARMED);
    frame(1000000, 4);
    CHECK(s.state == GAITMSG_STATUS_T_RUNNING && s.counts.frames == 1 && s.steps == 1);
    frame(1000000 + FRAME, 8);
    CHECK(s.counts.dropped == 3 && s.counts.frames == 2);
    frame(1000000 + FRAME, 8); /* arrives twice: rejected, but not dropped */
    CHECK(s.counts.dropped == 3 && s.counts.frames == 2 && text("did not advance") && s.counts.rejected == 1);
    frame(1000000 + 2 * FRAME, -1); /* without a number */
    CHECK(s.counts.frames == 3 && s.counts.dropped == 3);
    frame(1000000 + 2 * FRAME, -1);
    CHECK(s.counts.dropped == 3 && s.counts.rejected == 2);
    frame(1000000 + 3 * FRAME, INT64_C(1) << 40); /* a new count */
    CHECK(s.counts.frames == 4 && s.counts.dropped == 3);
    frame(1000000 + 4 * FRAME, 2);
    CHECK(s.counts.frames == 5 && s.counts.dropped == 3);
    image_view wrong = view(1000000 + 5 * FRAME, 3);
    wrong.width--;
    service_frame(&s, &wrong, true, 1);
    CHECK(s.counts.rejected == 3 && s.counts.dropped == 4 && s.counts.frames == 5);
    image_view const old = view(1000000 + 6 * FRAME, 4);
    service_frame(&s, &old, false, 1); /* a newer one waits */
    CHECK(s.counts.frames == 5 && s.counts.dropped == 5);
    end();
}

static void test_pauses(void)
{
    begin(NULL, NULL, false);
    announce(NULL, &CAMERA, 1);
    start(&s, 0);
    frame(10000000, 0);
    frame(11900000, 1); /* is bridged by steps without a picture */
    CHECK(s.counts.frames == 2 && s.steps == 2 && s.state == GAITMSG_STATUS_T_RUNNING);
    CHECK(s.past[s.steps % SERVICE_PAST].step != 1); /* more steps than frames */
    frame(13900001, 2);
    CHECK(s.state == GAITMSG_STATUS_T_READY &&
          text("no frame for 2.000 s (at most 2.000): stopped; searching"));
    start(&s, 0);
    frame(20000000, 3);
    frame(17000000, 4);
    CHECK(s.state == GAITMSG_STATUS_T_READY && text("capture time went back by 3.000 s"));
    start(&s, 5000000);
    frame(7500000, 5);
    CHECK(s.state == GAITMSG_STATUS_T_READY && text("the first frame is 2.500 s later than the start"));
    end();
}

/* ---- backgrounds ---- */
static void background(const uint8_t *data, int32_t format, int32_t width)
{
    int32_t const row = width * (format == GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY ? 1 : 3);
    image_view const v = {.width = width,
                          .height = HEIGHT,
                          .stride = row,
                          .pixelformat = format,
                          .size = row * HEIGHT,
                          .data = data};
    service_background(&s, &v);
}

static void test_background(void)
{
    begin(NULL, NULL, false);
    background(pixels, GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, WIDTH);
    CHECK(!s.track.background.data); /* no camera yet */
    announce(NULL, &CAMERA, 1);
    CHECK(lacks("--init auto needs the background"));
    background(pixels, GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, WIDTH - 1);
    CHECK(s.counts.rejected == 1 && !s.track.background.data);
    background(pixels, GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, WIDTH);
    CHECK(s.track.background.data && text("waiting for a walking person") && lacks("no person walks"));
    background(pixels, GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, WIDTH); /* as it is sent every few seconds */
    CHECK(s.track.background.format == GAIT_GREY8);
    background(other, GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, WIDTH);
    CHECK(memcmp(s.track.background.data, other, WIDTH * HEIGHT) == 0);
    background(pixels, GAITMSG_IMAGE_T_PIXEL_FORMAT_RGB, WIDTH);
    CHECK(s.track.background.format == GAIT_RGB8 && s.counts.rejected == 1);
    background(other, GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, WIDTH);
    frame(1000, 0); /* shows another scene */
    CHECK(text("half of the image differs from the background"));
    end();
}

/* ---- what is missing ---- */
static void test_lack(void)
{
    gait_camera large = CAMERA;
    large.width = 3 * WIDTH;
    begin(NULL, &more, false);
    CHECK(lacks("no camera: give --camera or announce it on GAIT_CAMERA_0"));
    announce(NULL, &large, 1);
    CHECK(lacks("no usable camera: camera with 144x32 pixels"));
    s.idle = SERVICE_IDLE_CAMERA;
    announce(NULL, &large, 2);
    CHECK(s.idle == SERVICE_IDLE_CAMERA); /* nothing new */
    announce(NULL, &CAMERA, 3);
    CHECK(lacks("announce it on GAIT_CAMERA_1"));
    announce(&more.camera[0], &CAMERA, 3);
    CHECK(s.state == GAITMSG_STATUS_T_READY && lacks("--init auto needs the background"));
    s.seek = false;
    CHECK(lacks("no START: send it on GAIT_COMMAND"));
    start(&s, 1000000);
    CHECK(lacks("the frame of the start did not arrive"));
    service_complain(&s, "the last complaint");
    message why;
    service_lack(&s, &why);
    CHECK(strcmp(why.text, "the last complaint") == 0);
    end();
}

/* ---- a further camera ---- */
static void test_further(void)
{
    begin(NULL, &more, false);
    further_camera *const c = &more.camera[0];
    image_view v = view(5, 0);
    announce(c, &CAMERA, 1);
    service_further_background(&s, c, &v); /* before there is a tracker */
    CHECK(c->background.data && s.counts.rejected == 0);
    announce(NULL, &CAMERA, 1);
    service_further_background(&s, c, &v);
    v.width--;
    service_further_background(&s, c, &v);
    CHECK(s.counts.rejected == 1 && text("48"));
    end();
}

/* ---- a moving camera ---- */
static void test_path(void)
{
    gait_camera moved = CAMERA, lens = CAMERA, below = CAMERA;
    begin(&path, NULL, false);
    announce(NULL, &CAMERA, 1000000);
    CHECK(shared.slot.known && path.count == 1 &&
          lacks("needs keypoints to find a person with a moving camera"));
    moved.t[0] = 0.1f;
    announce(NULL, &moved, 1000000 + FRAME);
    CHECK(path.count == 2 && shared.slot.camera.t[0] == 0.0f); /* a pose, not another camera */
    announce(NULL, &moved, 1000000);
    CHECK(path.refused == 1 && text("out of order"));
    lens.fx = 60;
    announce(NULL, &lens, 1000000 + 2 * FRAME);
    CHECK(path.count == 2 && text("a different camera from the one in use"));
    below.t[1] = -1; /* under the ground, as a pose it may be */
    announce(NULL, &below, 1000000 + 2 * FRAME);
    CHECK(path.count == 3);
    CHECK(service_waits(&s, 1000000 + 3 * FRAME) && !service_waits(&s, 1000000 + FRAME));
    start(&s, 1000000);
    frame(1000000, 0);
    CHECK(s.counts.frames == 1 && text("tracking"));
    frame(1500000, 1); /* no pose is known: it is only predicted */
    CHECK(s.counts.frames == 2 && path.unknown == 1 &&
          strstr(s.complaint.text, "no camera pose for a frame"));
    end();
}

/* ---- several people ---- */
static void test_people(void)
{
    begin(NULL, NULL, true);
    announce(NULL, &CAMERA, 1);
    CHECK(second.track.tracker && third.track.tracker && third.person == 3 && second.next == &third);
    background(pixels, GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, WIDTH);
    CHECK(third.track.background.data == s.track.background.data);
    for (int i = 0; i < 3; i++) { /* a message without joints is enough */
        keypoints_view nothing = {.utime = 1};
        message why;
        CHECK(service_waits(&s, 1) && keypoint_cue_take(&cue[i], &nothing, &why));
    }
    CHECK(!service_waits(&s, 1));
    start(&s, 0);
    start(&third, 0);
    frame(1000000, 0);
    CHECK(s.state == GAITMSG_STATUS_T_RUNNING && third.state == s.state && second.state != s.state);
    CHECK(shared.nearest_utime == -1); /* in the first frame it is not known where they are */
    s.last_status = GAIT_TRACK_TRACKING;
    frame(1000000 + FRAME, 1);
    CHECK(shared.nearest_utime == -1); /* one is not enough */
    s.last_status = third.last_status = GAIT_TRACK_TRACKING;
    frame(1000000 + 2 * FRAME, 2);
    CHECK(shared.nearest_utime == 1000000 + 2 * FRAME);
    s.last_status = GAIT_TRACK_TRACKING;
    third.last_status = GAIT_TRACK_LOST;
    frame(1000000 + 3 * FRAME, 3);
    CHECK(shared.nearest_utime == -1);
    s.last_status = third.last_status = GAIT_TRACK_TRACKING;
    frame(1000000 + 2 * FRAME, 4); /* before their last frame */
    CHECK(shared.nearest_utime == -1);
    CHECK(third.counts.rejected == 1 && strcmp(third.complaint.text, s.complaint.text) == 0);
    end();
}

/* The nearest person is seen in each pixel, in whichever order the bodies are given. */
static void test_nearest(void)
{
    static uint8_t drawing[WIDTH * HEIGHT], one[WIDTH * HEIGHT], two[WIDTH * HEIGHT];
    gait_state near, far;
    gait_tracker_prior(toy_model(), &near, &(gait_state){0}, NULL);
    near.pelvis[0] = near.pelvis[1] = 0;
    far = near;
    far.pelvis[1] = 1.5f; /* the camera looks along y */
    nearest_body a[] = {{1, near}, {2, far}, {3, near}}, b[] = {{2, far}, {1, near}, {3, near}};
    a[2].state.stature = b[2].state.stature = NAN; /* is not drawn */
    nearest_draw(toy_model(), &CAMERA, a, 3, drawing, one);
    nearest_draw(toy_model(), &CAMERA, b, 3, drawing, two);
    CHECK(memcmp(one, two, sizeof one) == 0);
    int count[4] = {0};
    for (size_t p = 0; p < sizeof one; p++)
        count[one[p] & 3]++;
    CHECK(count[1] > 0 && count[3] == 0);
    CHECK(gait_render(toy_model(), &CAMERA, &near, drawing, WIDTH, NULL) == GAIT_OK);
    for (size_t p = 0; p < sizeof one; p++)
        CHECK(!drawing[p] || one[p] == 1);
}

int main(void)
{
    size_t bytes;
    const void *const toy = toy_model_blob(&bytes);
    toy_written(model, toy, bytes);
    for (int i = 0; i < (int)sizeof pixels; i++) {
        pixels[i] = (uint8_t)(i * 37 % 200);
        other[i] = (uint8_t)(255 - i * 91 % 200);
    }
    test_commands();
    test_frames();
    test_pauses();
    test_background();
    test_lack();
    test_further();
    test_path();
    test_people();
    test_nearest();
    unlink(model);
    return CHECK_DONE();
}
