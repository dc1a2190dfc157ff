/* Keypoints of a detector: the term for one body, and that a tracker does better with them. */
#include "toy_error.h"
#include "toy_body.h"

enum { FRAMES = 40 };

/* Joints of a state in the scene's camera, as a detector would find them. */
static void detect(const gait_camera *cam, const gait_state *s, float noise, uint32_t seed,
                   gait_keypoint *out)
{
    gait_pose pose;
    CHECK(gait_model_pose(toy_model(), s, &pose, NULL) == GAIT_OK);
    for (int p = 0; p < TOY_POINTS; p++) {
        float uv[2] = {0.0f}, ud, vd;
        CHECK(camera_project(cam, pose.joint[p], uv) > 0.0f);
        camera_distort(cam, uv[0], uv[1], &ud, &vd);
        float const du = (float)(toy_hash(seed, (uint32_t)p, 1) % 2001) / 1000.0f - 1.0f;
        float const dv = (float)(toy_hash(seed, (uint32_t)p, 2) % 2001) / 1000.0f - 1.0f;
        out[p] = (gait_keypoint){
            .u = ud + 1.7f * noise * du, .v = vd + 1.7f * noise * dv, .sd = f_max(noise, 1.0f)};
    }
}

/* ---- the term ---- */
static float points[GAIT_MAX_JOINTS][3][BLOCK];

static like_body toy_view(toy_body *v, int lane)
{
    return (like_body){.setup = &v->setup,
                       .features = &v->f,
                       .camera = &v->cam,
                       .lane = lane,
                       .points = (const float (*)[3][BLOCK])points};
}

static void test_cost(void)
{
    toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    gait_state const s = toy_walk(0.3f);
    gait_pose pose;
    like_body const b = toy_view(v, 3);
    CHECK(like_keypoints.flag == GAIT_TERM_KEYPOINTS);
    CHECK(gait_model_pose(toy_model(), &s, &pose, NULL) == GAIT_OK);
    v->f.keypoints = (features_keypoints){0};
    CHECK(like_keypoints.log_likelihood(&b) == 0.0f && like_keypoints.support(&b) == 0.0f);
    for (int p = 0; p < 4; p++) {
        float uv[2] = {0.0f};
        camera_project(&v->cam, pose.joint[p], uv);
        v->f.keypoints.u[p] = uv[0] + (p == 2 ? 3.0f : 0.0f);
        v->f.keypoints.v[p] = uv[1] - (p == 2 ? 4.0f : 0.0f);
        for (int k = 0; k < 3; k++)
            points[p][k][3] = pose.joint[p][k];
        v->f.keypoints.inverse_sd[p] = p == 1 ? 0.0f : 0.5f; /* 2 pixels; the second is not seen */
    }
    v->f.keypoints.v[1] = NAN; /* is not read */
    v->f.keypoints.count = 3;
    double const want = 3.0 * log(1.0 + 0.25 * 6.25) / 3.0; /* 5 pixels at one of three joints */
    CHECK_NEAR(like_keypoints.log_likelihood(&b), -want, 1e-4);
    CHECK_NEAR(like_keypoints.support(&b), 3.0 * log(17.0) - want, 1e-4);
    points[0][1][3] -=
        100.0f; /* behind the camera: as bad as keypoints of another person, 4 nats of a weight of 8 */
    CHECK_NEAR(like_keypoints.log_likelihood(&b), -3.0 * log(17.0) - 0.5, 1e-4);
    CHECK_NEAR(like_keypoints.support(&b), -0.5, 1e-4);
}

/* A part whose sides the detector has confused, and nothing else, costs the log odds of that, 3 to 1. */
static void test_confused_sides(void)
{
    static const char *const part[2][5] = {{"hip", "knee", "ankle", "toe", "heel"},
                                           {"shoulder", "elbow", "wrist"}};
    toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    gait_state const s = toy_walk(0.3f);
    gait_pose pose;
    CHECK(gait_model_pose(toy_model(), &s, &pose, NULL) == GAIT_OK);
    float const weight = v->setup.weight[LIKE_KEYPOINTS];
    double best = 0.0;
    for (int k = -1; k < 2; k++) {
        v->f.keypoints = (features_keypoints){.count = TOY_POINTS};
        for (int p = 0; p < TOY_POINTS; p++) {
            const char *const name = gait_model_joint_name(toy_model(), p);
            int from = p;
            for (int i = 0; k >= 0 && i < 5; i++)
                for (int q = 0; q < TOY_POINTS && part[k][i] && name[1] == '_'; q++) {
                    const char *const other = gait_model_joint_name(toy_model(), q);
                    if (!strcmp(name + 2, part[k][i]) && !strcmp(name + 1, other + 1) && q != p)
                        from = q;
                }
            float uv[2] = {0.0f};
            camera_project(&v->cam, pose.joint[from], uv);
            v->f.keypoints.u[p] = uv[0];
            v->f.keypoints.v[p] = uv[1];
            v->f.keypoints.inverse_sd[p] = 0.5f;
            for (int i = 0; i < 3; i++)
                points[p][i][3] = pose.joint[p][i];
        }
        like_body const b = toy_view(v, 3);
        double const cost = -(double)(weight * like_keypoints.log_likelihood(&b));
        best = k < 0 ? cost : best;
        CHECK_NEAR(cost - best, k < 0 ? 0.0 : log(3.0), 1e-2);
    }
}

/* ---- the tracker ---- */
typedef struct given { /* what the detector does */
    uint32_t terms;
    float noise;
    bool keypoints, strange; /* strange: one joint is always somewhere else */
    int swapped;             /* of ten frames in a row it swaps the sides of so many */
    int others;              /* frames, in the middle of the film, in which it finds another person instead */
    float aside;             /* metres of that person from this one, who is half a stride ahead */
} given;

static error follow(const given *g, uint64_t *digest)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.terms = g->terms;
    cfg.edges_weight = g->others ? cfg.edges_weight : 1.0f; /* 1: an image with little evidence */
    cfg.keypoints_weight = 8.0f;
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    gait_keypoint track[GAIT_MAX_JOINTS];
    error out = {0};
    gait_estimate e;
    for (int n = 0; n < FRAMES; n++) {
        gait_state found = toy_walk((float)n / 30.0f);
        gait_frame f = toy_frame(n);
        if (n >= FRAMES / 2 && n < FRAMES / 2 + g->others) {
            found.pelvis[0] += g->aside;
            found.phase = m_wrap1(found.phase + 0.5f);
        }
        if (n % 10 < g->swapped)
            found.phase = m_wrap1(found.phase + 0.5f);
        f.image[0] = toy_image(film[0][n]);
        detect(&cfg.camera[0], &found, g->noise, (uint32_t)n, track);
        if (g->strange)
            track[7].u += 60.0f;
        track[4].sd = n % 3 ? track[4].sd : INFINITY;
        f.keypoints[0] = g->keypoints ? track : NULL;
        CHECK(gait_tracker_step(t, &f, &e, NULL) == GAIT_OK);
        if (n >= 15)
            measure_error(&e, n, &out);
        out.status[e.status]++;
    }
    *digest = gait_tracker_digest(t);
    toy_tracker_free(t);
    return out;
}

static void test_tracker(void)
{
    uint64_t plain, ignored, alone, helped, outliers;
    given g = {.terms = GAIT_TERM_EDGES, .noise = 1.0f};
    error const edges = follow(&g, &plain);
    g.keypoints = true;
    (void)follow(&g, &ignored);
    CHECK(ignored == plain); /* the term is off: tracks are not read */
    g.terms = GAIT_TERM_EDGES | GAIT_TERM_KEYPOINTS;
    error const both = follow(&g, &helped);
    g.strange = true;
    error const strange = follow(&g, &outliers);
    g = (given){.terms = GAIT_TERM_KEYPOINTS, .noise = 1.0f, .keypoints = true};
    error const tracks = follow(&g, &alone);
    CHECK(helped != plain && outliers != helped && alone != helped);
    CHECK(both.joint < 0.8 * edges.joint && both.joint < 0.04);
    CHECK(strange.joint < 1.5 * both.joint && tracks.joint < 0.05);
}

/* For half a second the detector finds another person, or has jumped: the images keep the track. */
static void test_another_person(void)
{
    static const float aside[] = {-2.0f, -0.3f, 0.3f, 0.6f};
    for (int k = 0; k < 4; k++) {
        uint64_t digest;
        given const g = {.terms = GAIT_TERMS_DEFAULT | GAIT_TERM_KEYPOINTS,
                         .noise = 1.0f,
                         .keypoints = true,
                         .others = 15,
                         .aside = aside[k]};
        error const e = follow(&g, &digest);
        CHECK(e.joint < 0.012 && e.status[GAIT_TRACK_LOST] == 0);
    }
}

/* A detector that swaps the sides now and then leaves left and right known, one that does so in most frames does not. */
static void test_swapped_sides(void)
{
    for (int swapped = 0; swapped <= 10; swapped++) {
        uint64_t digest;
        given const g = {.terms = GAIT_TERMS_DEFAULT | GAIT_TERM_KEYPOINTS,
                         .noise = 1.0f,
                         .keypoints = true,
                         .swapped = swapped};
        error const e = follow(&g, &digest);
        CHECK(e.joint < 0.025 && e.status[GAIT_TRACK_LOST] == 0);
        CHECK(swapped > 1 || e.status[GAIT_TRACK_TRACKING] == FRAMES);
        CHECK(swapped < 7 || e.status[GAIT_TRACK_AMBIGUOUS] >= FRAMES * 3 / 4);
    }
}

int main(void)
{
    film_make(1, FRAMES);
    test_cost();
    test_confused_sides();
    test_tracker();
    test_another_person();
    test_swapped_sides();
    return CHECK_DONE();
}
