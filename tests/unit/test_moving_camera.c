/* Cameras whose pose comes with each frame. */
#include "image/camera.h"
#include "tracker/features_step.h"
#include "tracker/likelihood_step.h"

#include <math.h>
#include <stddef.h>

#include "toy_tracker.h"

#include "check.h"

enum { FRAMES = 24 };

static uint8_t picture[SCENE_PIXELS], wall[SCENE_PIXELS];

static gait_camera_pose pose_of(const gait_camera *c)
{
    gait_camera_pose p = {.turn_sd = 0.0f};
    memcpy(p.R, c->R, sizeof p.R);
    memcpy(p.t, c->t, sizeof p.t);
    return p;
}

/* The side camera at x, turned to the left by an angle. */
static gait_camera camera_at(float x, float turn)
{
    gait_camera c = toy_camera(0);
    float const sn = sinf(turn), cs = cosf(turn);
    const float R[9] = {cs, sn, 0, 0, 0, -1, -sn, cs, 0}, place[3] = {x, -c.t[2], c.t[1]};
    memcpy(c.R, R, sizeof R);
    for (int k = 0; k < 3; k++)
        c.t[k] = -(R[3 * k] * place[0] + R[3 * k + 1] * place[1] + R[3 * k + 2] * place[2]);
    return c;
}

/* Frame n as a camera sees it, before a wall that it always sees alike. */
static void shoot(const gait_camera *c, int n)
{
    gait_state const s = toy_walk((float)n / 30.0f);
    memcpy(picture, wall, sizeof picture);
    toy_paint(c, &s, picture);
    toy_noise((uint32_t)n, picture);
}

static gait_tracker *tracker(uint32_t terms)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.terms = terms;
    cfg.camera[0] = camera_at(0.0f, 0.0f);
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_image const plate = toy_image(wall);
    CHECK(gait_tracker_set_background(t, 0, &plate, NULL) == GAIT_OK);
    toy_tracker_start(t, 0, 0.5f);
    return t;
}

static gait_estimate step(gait_tracker *t, int n, const gait_camera_pose *pose, const gait_image *background)
{
    gait_frame f = toy_frame(n);
    gait_estimate e = {.ess = 0.0f};
    gait_error err = {.text = ""};
    f.image[0] = toy_image(picture);
    f.pose[0] = pose;
    if (background)
        f.background[0] = *background;
    CHECK(gait_tracker_step(t, &f, &e, &err) == GAIT_OK);
    return e;
}

static float off(const gait_estimate *e, int n)
{
    gait_state const s = toy_walk((float)n / 30.0f);
    return hypotf(e->mean.pelvis[0] - s.pelvis[0], e->mean.pelvis[1] - s.pelvis[1]);
}

/* A path of equal poses gives the bits of a camera that stands still, and so does the frame of an older header. */
static void test_still(void)
{
    gait_camera const cam = camera_at(0.0f, 0.0f);
    gait_camera_pose const pose = pose_of(&cam);
    gait_tracker *const still = tracker(GAIT_TERMS_DEFAULT), *const path = tracker(GAIT_TERMS_DEFAULT),
                        *const older = tracker(GAIT_TERMS_DEFAULT);
    for (int n = 0; n < 8; n++) {
        shoot(&cam, n);
        gait_frame f = toy_frame(n);
        f.struct_size = offsetof(gait_frame, pose);
        f.image[0] = toy_image(picture);
        f.pose[0] = (const gait_camera_pose *)(const void *)&f; /* not read */
        gait_estimate old;
        CHECK(gait_tracker_step(older, &f, &old, NULL) == GAIT_OK);
        gait_estimate const a = step(still, n, NULL, NULL), b = step(path, n, &pose, NULL);
        CHECK(memcmp(&a, &b, sizeof a) == 0 && memcmp(&a, &old, sizeof a) == 0);
    }
    CHECK(gait_tracker_digest(still) == gait_tracker_digest(path));
    CHECK(gait_tracker_digest(still) == gait_tracker_digest(older));
    toy_tracker_free(still);
    toy_tracker_free(path);
    toy_tracker_free(older);
}

/* The person is followed in the world while the camera drives past them and turns; a snapshot goes on alike. */
static void test_follows(void)
{
    gait_tracker *const t = tracker(GAIT_TERMS_DEFAULT), *const again = tracker(GAIT_TERMS_DEFAULT);
    static unsigned char snapshot[1 << 24];
    size_t bytes = 0;
    for (int n = 0; n < FRAMES; n++) {
        gait_camera const cam = camera_at(-1.0f + 0.08f * (float)n, 0.25f - 0.02f * (float)n);
        gait_camera_pose const pose = pose_of(&cam);
        shoot(&cam, n);
        gait_estimate const e = step(t, n, &pose, NULL);
        CHECK(off(&e, n) < 0.06f && !t->camera[0].features.has_foreground);
        if (bytes > 0) {
            gait_estimate const same = step(again, n, &pose, NULL);
            CHECK(memcmp(&e, &same, sizeof e) == 0);
        } else if (n == 10) {
            CHECK(gait_tracker_save(t, snapshot, sizeof snapshot, &bytes, NULL) == GAIT_OK);
            CHECK(gait_tracker_restore(again, snapshot, bytes, NULL) == GAIT_OK);
        }
    }
    toy_tracker_free(t);
    toy_tracker_free(again);
}

/* The empty scene of a frame counts only in that frame; that of the config counts if the config has the camera. */
static void test_background(void)
{
    gait_camera const home = camera_at(0.0f, 0.0f), away = camera_at(0.4f, 0.1f);
    gait_camera_pose const at_home = pose_of(&home), elsewhere = pose_of(&away);
    gait_tracker *const t = tracker(GAIT_TERMS_DEFAULT);
    gait_image const plate = toy_image(wall), other = toy_image(picture);
    const features *const f = &t->camera[0].features;
    memcpy(picture, wall, sizeof picture);
    step(t, 0, &elsewhere, NULL);
    CHECK(!f->has_foreground);
    step(t, 1, &elsewhere, &plate);
    CHECK(f->has_foreground && f->foreground_total == 0);
    memset(picture, 255, sizeof picture);
    step(t, 2, &elsewhere, &other);
    CHECK(f->has_foreground && f->foreground_total == 0);
    step(t, 3, &at_home, NULL);
    CHECK(f->has_foreground && f->foreground_total > 0);
    toy_tracker_free(t);
}

/* Poses with errors of 1 degree: where their standard deviations are given, the shift of the image is found and the
 * person walks on. */
/* Displaced bodies are restored exactly, for the next camera and the next shift. */
static void bodies_stay(gait_tracker *t)
{
    likelihood_scratch *const w = &t->work[0];
    kin_body const body = w->body;
    float points[GAIT_MAX_JOINTS][3][BLOCK], nats[BLOCK], again[BLOCK];
    size_t const bytes = (size_t)t->model->points * sizeof *points;
    int32_t index[BLOCK];
    for (int32_t i = 0; i < BLOCK; i++)
        index[i] = i;
    memcpy(points, w->points, bytes);
    CHECK(t->camera[0].shift_sd > 0.0f);
    likelihood_particles(t, 0, index, BLOCK, w, nats);
    CHECK(memcmp(&body, &w->body, sizeof body) == 0 && memcmp(points, w->points, bytes) == 0);
    likelihood_particles(t, 0, index, BLOCK, w, again);
    CHECK(memcmp(nats, again, sizeof nats) == 0);
}

static void test_uncertain_poses(void)
{
    gait_tracker *const stated = tracker(GAIT_TERMS_DEFAULT), *const unstated = tracker(GAIT_TERMS_DEFAULT);
    float const error = 0.0175f;
    float steady = 0.0f, jumping = 0.0f, last[2] = {0}, sd[2] = {0};
    for (int n = 0; n < FRAMES; n++) {
        float const sign = toy_hash((uint32_t)n, 3, 4) & 1 ? 1.0f : -1.0f;
        gait_camera const true_one = camera_at(0.0f, 0.0f), wrong = camera_at(0.0f, sign * error);
        gait_camera_pose pose = pose_of(&wrong);
        shoot(&true_one, n);
        gait_estimate const b = step(unstated, n, &pose, NULL);
        pose.turn_sd = error;
        gait_estimate const a = step(stated, n, &pose, NULL);
        float const moved = stated->cfg.camera[0].cx - stated->home[0].cx;
        CHECK_NEAR(moved, -sign * error * true_one.fx, 5.0);
        if (n > 0) {
            steady += fabsf(a.mean.pelvis[0] - last[0]);
            jumping += fabsf(b.mean.pelvis[0] - last[1]);
        }
        last[0] = a.mean.pelvis[0];
        last[1] = b.mean.pelvis[0];
        sd[0] = a.joint_sd[0][0];
        sd[1] = b.joint_sd[0][0];
        CHECK(off(&a, n) < 0.06f);
    }
    bodies_stay(stated);
    CHECK(steady < jumping);
    CHECK(sd[0] > error * 5.0f && sd[1] < error * 5.0f); /* the pose at 5.5 m is in the estimate */
    toy_tracker_free(stated);
    toy_tracker_free(unstated);
}

static void refused(gait_tracker *t, const gait_frame *f, gait_result want, const char *words)
{
    uint64_t const digest = gait_tracker_digest(t);
    gait_estimate e;
    gait_error err = {.text = ""};
    CHECK(gait_tracker_step(t, f, &e, &err) == want && strstr(err.text, words) != NULL);
    CHECK(gait_tracker_digest(t) == digest);
}

static void test_refusals(void)
{
    gait_camera const cam = camera_at(0.0f, 0.0f);
    gait_tracker *const t = tracker(GAIT_TERMS_DEFAULT);
    gait_camera_pose pose = pose_of(&cam);
    gait_frame f = toy_frame(0);
    f.pose[0] = &pose;
    pose.R[0] = 0.9f;
    refused(t, &f, GAIT_ERR_ARG, "R a rotation");
    pose = pose_of(&cam);
    pose.t[1] = NAN;
    refused(t, &f, GAIT_ERR_ARG, "pose: t = nan");
    pose = pose_of(&cam);
    pose.turn_sd = -0.1f;
    refused(t, &f, GAIT_ERR_ARG, "pose: turn_sd = -0.1 is outside [0, 1]");
    pose = pose_of(&cam);
    f.background[0] = toy_image(wall);
    f.background[0].width--;
    refused(t, &f, GAIT_ERR_ARG, "background of camera 0 is");
    f.struct_size = 20;
    refused(t, &f, GAIT_ERR_STRUCT, "gait_frame");
    toy_tracker_free(t);
}

int main(void)
{
    toy_wall(0, wall);
    test_still();
    test_follows();
    test_background();
    test_uncertain_poses();
    test_refusals();
    return CHECK_DONE();
}
