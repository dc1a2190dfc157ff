/* The automatic start: walks of known place, heading, phase, rate and stature are found from their keypoints. */
#include "base/hash.h"
#include "base/rng.h"
#include "filter/particles.h"
#include "image/camera.h"
#include "toy_classes.h"
#include "toy_start.h"

#include <string.h>

enum { FRAMES = 26, JOINTS = TOY_POINTS };

typedef struct walk { /* from which keypoints are generated */
    float heading, speed, rate, stature, phase, x, y;
    float noise;      /* pixels */
    float wrong;      /* share of keypoints that are somewhere else */
    bool legs_cut;    /* hips and ankles are not in view */
    float drive, pan; /* of the camera, to the right and to the left: metres and radians per second */
    bool back;        /* they walk backwards */
} walk;

static walk usual(void)
{
    return (walk){.heading = 0.4f, .speed = 1.3f, .rate = 0.95f, .stature = 1.75f, .phase = 0.2f, .y = 5.0f};
}

static gait_camera camera(void)
{
    return level_camera(1280, 720, 1000.0f);
}

/* The camera at a moment. */
static gait_camera camera_at(const walk *w, float t)
{
    gait_camera c = camera();
    float sn, cs;
    m_sincos_one(w->pan * t, &sn, &cs);
    const float R[9] = {cs, sn, 0, 0, 0, -1, -sn, cs, 0}, x = w->drive * t;
    const float move[3] = {-R[0] * x, c.t[1], -R[6] * x};
    return camera_placed(&c, R, move);
}

static gait_state state_at(const walk *w, float t)
{
    float const ahead = w->back ? -t : t;
    gait_state s = toy_state(m_wrap1(w->phase + w->rate * ahead));
    s.heading = w->heading;
    s.stature = w->stature;
    s.stride_hz = w->rate;
    float height, sn, cs;
    m_sincos_one(w->heading, &sn, &cs);
    CHECK(gait_model_pelvis_height(toy_model(), &s, &height, NULL) == GAIT_OK);
    s.pelvis[0] = w->x + w->speed * ahead * cs;
    s.pelvis[1] = w->y + w->speed * ahead * sn;
    s.pelvis[2] = height;
    return s;
}

static void detect(const walk *w, float t, uint32_t n, gait_keypoint *out)
{
    gait_camera const cam = camera_at(w, t);
    gait_state const s = state_at(w, t);
    gait_pose pose;
    CHECK(gait_model_pose(toy_model(), &s, &pose, NULL) == GAIT_OK);
    for (int32_t j = 0; j < JOINTS; j++) {
        float uv[2] = {0}, e[4];
        uint32_t r[4];
        (void)camera_project(&cam, pose.joint[j], uv);
        rng_normal4(7, 1, n, (uint32_t)j, 0, e);
        rng_bits(7, 2, n, (uint32_t)j, 0, r);
        out[j] = (gait_keypoint){uv[0] + w->noise * e[0], uv[1] + w->noise * e[1], f_max(w->noise, 0.5f)};
        if ((float)(r[0] >> 8) < w->wrong * 16777216.0f)
            out[j] = (gait_keypoint){(float)(r[1] >> 22), (float)(r[2] >> 23), out[j].sd};
        if (w->legs_cut && j >= 9)
            out[j].sd = -1.0f;
    }
}

static void show(gait_start *s, const walk *w, int frames)
{
    gait_keypoint k[JOINTS];
    for (int n = 0; n < frames; n++) {
        detect(w, (float)n / 25.0f, (uint32_t)n, k);
        if (w->drive > 0.0f) {
            gait_camera const c = camera_at(w, (float)n / 25.0f);
            gait_camera_pose pose = {.turn_sd = 0.0f};
            memcpy(pose.R, c.R, sizeof pose.R);
            memcpy(pose.t, c.t, sizeof pose.t);
            CHECK(gait_start_set_pose(s, &pose, NULL) == GAIT_OK);
        }
        CHECK(gait_start_add(s, 1000000 + n * 40000, k, NULL) == GAIT_OK);
    }
}

static gait_hypothesis find_with(const gait_model *model, const walk *w, uint32_t cpu_mask)
{
    gait_start *const s = toy_start_of(model, camera(), cpu_mask);
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    int32_t count = 0;
    show(s, w, FRAMES);
    CHECK(gait_start_solve(s, 1000000, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) == GAIT_OK);
    CHECK(count >= 1);
    free(s);
    return h[0];
}

static gait_hypothesis find(const walk *w)
{
    return find_with(toy_model(), w, ~0u);
}

static float turned(float a, float b)
{
    return fabsf(m_wrap_pi(a - b));
}

static void check_found(const walk *w, const gait_hypothesis *h)
{
    gait_state const truth = state_at(w, 0.0f);
    CHECK(turned(h->mean.heading, truth.heading) < 0.12f);
    CHECK(turned(TWO_PI_F * h->mean.phase, TWO_PI_F * truth.phase) < TWO_PI_F * 0.04f);
    CHECK_NEAR(h->mean.stride_hz, truth.stride_hz, 0.06);
    CHECK_NEAR(h->speed, w->speed, 0.15);
    CHECK_NEAR(h->mean.stature, truth.stature, 0.15); /* size and distance are confounded in one view */
    for (int k = 0; k < 2; k++)
        CHECK(fabsf(h->mean.pelvis[k] - truth.pelvis[k]) < 3.0f * h->sd.pelvis[k] + 0.1f);
}

static void test_headings(void)
{
    for (int k = 0; k < 8; k++) {
        walk w = usual();
        w.heading = (float)k * 0.785f + 0.1f;
        w.phase = (float)k / 8.0f;
        w.noise = 2.0f;
        gait_hypothesis const h = find(&w);
        check_found(&w, &h);
        CHECK(!h.in_place && h.probability > 0.9f);
        CHECK(h.chi2_per_observation < 1.5f && h.observations == 2 * JOINTS * 12);
    }
}

/* A camera that drives past the person and turns to them, its poses given. */
static void test_moving_camera(void)
{
    walk w = usual();
    w.drive = 1.5f;
    w.pan = -0.2f;
    w.noise = 2.0f;
    gait_hypothesis const h = find(&w);
    check_found(&w, &h);
    CHECK(!h.in_place && h.probability > 0.9f && h.chi2_per_observation < 1.5f);
    gait_start *const s = toy_start_new(camera(), ~0u);
    gait_camera_pose bad = {.turn_sd = 0.0f};
    CHECK(gait_start_set_pose(s, &bad, NULL) == GAIT_ERR_ARG &&
          gait_start_set_pose(s, NULL, NULL) != GAIT_OK);
    free(s);
}

static void test_slow_and_fast(void)
{
    walk slow = usual(), fast = usual();
    slow.speed = 0.6f;
    slow.rate = 0.6f;
    fast.speed = 2.0f;
    fast.rate = 1.2f;
    gait_hypothesis h = find(&slow);
    check_found(&slow, &h);
    h = find(&fast);
    check_found(&fast, &h);
}

/* A model with a class that walks backwards finds either, at the right moment of the stride. */
static void test_backwards(void)
{
    for (int k = 0; k < 8; k++) {
        walk w = usual();
        w.heading = (float)k * 0.785f + 0.1f;
        w.phase = (float)k / 8.0f;
        w.noise = 2.0f;
        w.back = k % 2 == 0;
        gait_hypothesis const h = find_with(toy_classes_model(), &w, ~0u),
                              scalar = find_with(toy_classes_model(), &w, 0);
        CHECK(!memcmp(&h, &scalar, sizeof h));
        check_found(&w, &h);
        CHECK(h.mean.motion_class == (w.back ? TOY_BACK : TOY_WALK) && gait_hypothesis_walks(&h));
    }
}

static void test_treadmill(void)
{
    walk w = usual();
    w.speed = 0.0f;
    w.noise = 2.0f;
    gait_hypothesis const h = find(&w);
    check_found(&w, &h);
    CHECK(h.in_place);
}

static void test_outliers(void)
{
    walk w = usual();
    w.noise = 2.0f;
    w.wrong = 0.15f;
    gait_hypothesis const h = find(&w);
    check_found(&w, &h);
}

static void test_no_walk(void)
{
    walk w = usual();
    w.wrong = 1.0f;
    gait_hypothesis const h = find(&w);
    CHECK(h.chi2_per_observation > 3.0f); /* from which the caller sees that nothing fits */
}

/* Over many draws, nine of ten truths are within 1.64 standard deviations. */
static void test_coverage(void)
{
    int inside = 0, all = 0;
    for (int k = 0; k < 20; k++) {
        walk w = usual();
        w.heading = 0.3f * (float)k;
        w.noise = 4.0f;
        w.phase = m_wrap1(0.37f * (float)k);
        gait_hypothesis const h = find(&w);
        gait_state const truth = state_at(&w, 0.0f);
        float const off[] = {turned(h.mean.heading, truth.heading) / h.sd.heading,
                             turned(TWO_PI_F * h.mean.phase, TWO_PI_F * truth.phase) /
                                 (TWO_PI_F * h.sd.phase),
                             fabsf(h.mean.stride_hz - truth.stride_hz) / h.sd.stride_hz};
        for (int i = 0; i < 3; i++, all++)
            inside += off[i] < 1.645f;
    }
    CHECK(inside >= 8 * all / 10);
}

/* One view confounds size and distance: a person who is taller is further away, along the ray of the camera. */
static void test_correlation(void)
{
    enum { STATURE = 2, X = 4, Y = 5 };
    for (int side = -1; side <= 1; side += 2) {
        walk w = usual();
        w.x = 2.5f * (float)side;
        w.noise = 2.0f;
        gait_hypothesis const h = find(&w);
        CHECK(h.correlation[STATURE][Y] > 0.6f && (float)side * h.correlation[STATURE][X] > 0.5f);
        CHECK((float)side * h.correlation[X][Y] > 0.6f);
        for (int i = 0; i < 6; i++)
            for (int k = 0; k < 6; k++)
                CHECK(fabsf(h.correlation[i][k]) <= 1.0f && h.correlation[i][k] == h.correlation[k][i]);
    }
}

static void test_refused(void)
{
    gait_start *const s = toy_start_new(camera(), ~0u);
    gait_hypothesis h;
    gait_keypoint k[JOINTS] = {{0}};
    gait_error err = {0};
    int32_t count = 0;
    CHECK(gait_start_solve(s, 0, &h, 1, &count, &err) == GAIT_ERR_STATE);
    CHECK(strstr(err.text, "four or more over 0.3 s"));
    walk w = usual();
    w.legs_cut = true;
    show(s, &w, FRAMES);
    CHECK(gait_start_solve(s, 0, &h, 1, &count, &err) == GAIT_ERR_STATE);
    CHECK(gait_start_add(s, 1000000, k, &err) == GAIT_ERR_STATE && strstr(err.text, "utime"));
    gait_start_reset(s);
    CHECK(gait_start_add(s, 0, k, &err) == GAIT_OK);
    CHECK(gait_start_solve(s, 0, &h, 0, &count, &err) == GAIT_ERR_ARG);
    CHECK(gait_start_solve(s, 0, NULL, 1, &count, NULL) == GAIT_ERR_ARG);
    free(s);
}

/* Four frames over 0.3 s suffice, as the error states; a microsecond less does not, nor do three frames. */
static void test_fewest_frames(void)
{
    walk const w = usual();
    for (int kind = 0; kind < 3; kind++) {
        gait_start *const s = toy_start_new(camera(), ~0u);
        gait_keypoint k[JOINTS];
        gait_hypothesis h;
        int32_t const frames = kind == 2 ? 3 : 4;
        int32_t count = 0;
        for (int32_t n = 0; n < frames; n++) {
            int32_t const utime = 300000 * n / (frames - 1) - (kind == 1 && n == 3);
            detect(&w, 1e-6f * (float)utime, (uint32_t)n, k);
            CHECK(gait_start_add(s, utime, k, NULL) == GAIT_OK);
        }
        CHECK(gait_start_solve(s, 300000, &h, 1, &count, NULL) == (kind == 0 ? GAIT_OK : GAIT_ERR_STATE));
        free(s);
    }
}

static void refuse(void (*spoil)(gait_start_config *), gait_result result, const char *text)
{
    gait_start_config cfg;
    gait_error err = {0};
    size_t bytes;
    gait_start_default(&cfg);
    cfg.camera = camera();
    spoil(&cfg);
    CHECK(gait_start_bytes(toy_model(), &cfg, &bytes, &err) == result);
    CHECK(strstr(err.text, text));
}

static void spoil_size(gait_start_config *c)
{
    c->struct_size = 3;
}

static void spoil_stature(gait_start_config *c)
{
    c->stature = 3.0f;
}

static void spoil_camera(gait_start_config *c)
{
    c->camera.R[0] = 2.0f;
}

static void spoil_noise(gait_start_config *c)
{
    c->joint_sd = NAN;
}

static void test_config(void)
{
    refuse(spoil_size, GAIT_ERR_STRUCT, "gait_start_default");
    refuse(spoil_stature, GAIT_ERR_ARG, "stature");
    refuse(spoil_camera, GAIT_ERR_ARG, "camera");
    refuse(spoil_noise, GAIT_ERR_ARG, "joint_sd");
}

/* Later frames replace the first ones; the hypotheses of what is kept are the same as without them. */
static void test_old_frames_are_dropped(void)
{
    gait_start *const s = toy_start_new(camera(), ~0u);
    gait_hypothesis a, b;
    gait_keypoint k[JOINTS];
    int32_t count;
    walk other = usual(), w = usual();
    other.heading = 3.0f;
    for (int n = 0; n < 40; n++) {
        detect(&other, (float)n / 25.0f, (uint32_t)n, k);
        CHECK(gait_start_add(s, n - 100, k, NULL) == GAIT_OK);
    }
    show(s, &w, GAIT_START_MAX_FRAMES);
    CHECK(gait_start_solve(s, 1000000, &a, 1, &count, NULL) == GAIT_OK);
    gait_start_reset(s);
    show(s, &w, GAIT_START_MAX_FRAMES);
    CHECK(gait_start_solve(s, 1000000, &b, 1, &count, NULL) == GAIT_OK);
    CHECK(!memcmp(&a, &b, sizeof a));
    free(s);
}

static uint64_t digest(uint32_t cpu_mask)
{
    gait_start *const s = toy_start_new(camera(), cpu_mask);
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    int32_t count = 0;
    walk w = usual();
    w.noise = 3.0f;
    memset(h, 0, sizeof h);
    show(s, &w, FRAMES);
    CHECK(gait_start_solve(s, 1500000, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) == GAIT_OK);
    free(s);
    return toy_hash_hypotheses(h);
}

/* A known stature is kept; with it, and with errors that are independent from frame to frame, the walk is the same. */
static void test_a_known_stature(void)
{
    walk w = usual();
    w.stature = 1.9f;
    w.noise = 2.0f;
    gait_start_config cfg;
    gait_start *s = NULL;
    gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
    size_t bytes = 0;
    int32_t count = 0;
    gait_start_default(&cfg);
    cfg.camera = camera();
    cfg.stature = 1.9f;
    cfg.stature_sd = 0.01f;
    cfg.error_time = 0.0f;
    CHECK(gait_start_bytes(toy_model(), &cfg, &bytes, NULL) == GAIT_OK);
    void *const mem = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
    CHECK(gait_start_init(mem, bytes, toy_model(), &cfg, &s, NULL) == GAIT_OK);
    show(s, &w, FRAMES);
    CHECK(gait_start_solve(s, 1000000, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) == GAIT_OK);
    check_found(&w, h);
    CHECK_NEAR(h[0].mean.stature, 1.9f, 0.03);
    CHECK(h[0].sd.stature == 0.03f); /* the least that is stated */
    free(mem);
}

/* Keypoints with a number that is not finite count as not observed. */
static void test_keypoints_that_are_no_numbers(void)
{
    walk const w = usual();
    uint64_t hash[2];
    for (int spoilt = 0; spoilt < 2; spoilt++) {
        gait_start *const s = toy_start_new(camera(), ~0u);
        gait_hypothesis h[GAIT_START_MAX_HYPOTHESES];
        int32_t count = 0;
        memset(h, 0, sizeof h);
        for (int n = 0; n < FRAMES; n++) {
            gait_keypoint k[JOINTS];
            detect(&w, (float)n / 25.0f, (uint32_t)n, k);
            k[1] = spoilt ? (gait_keypoint){NAN, k[1].v, 1} : (gait_keypoint){0};
            k[2] = spoilt ? (gait_keypoint){k[2].u, INFINITY, 1} : (gait_keypoint){0};
            k[3] = spoilt ? (gait_keypoint){k[3].u, k[3].v, INFINITY} : (gait_keypoint){0};
            k[4] = spoilt ? (gait_keypoint){k[4].u, k[4].v, NAN} : (gait_keypoint){0};
            CHECK(gait_start_add(s, 1000000 + n * 40000, k, NULL) == GAIT_OK);
        }
        CHECK(gait_start_solve(s, 1000000, h, GAIT_START_MAX_HYPOTHESES, &count, NULL) == GAIT_OK);
        check_found(&w, h);
        hash[spoilt] = toy_hash_hypotheses(h);
        free(s);
    }
    CHECK(hash[0] == hash[1]);
}

#define GOLDEN UINT64_C(0xa5f9d07a9d04b879)

static void tests(void)
{
    test_headings();
    test_moving_camera();
    test_slow_and_fast();
    test_backwards();
    test_treadmill();
    test_outliers();
    test_no_walk();
    test_coverage();
    test_correlation();
    test_refused();
    test_fewest_frames();
    test_config();
    test_old_frames_are_dropped();
    test_a_known_stature();
    test_keypoints_that_are_no_numbers();
}

int main(int argc, char **argv)
{
    return golden_main(argc, argv, tests, digest, GOLDEN, "start");
}
