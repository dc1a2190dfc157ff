/* The limits of tracking: first frames, refused frames, track loss, ambiguity, learnt appearance. */
#include "tracker/tracker.h"

#include "toy_error.h"

/* ---- time ---- */

/* The first frame, if taken at the time of the start, only weights the particles; a later one also moves them. */
static void test_first_frame(void)
{
    static gait_state before[300], after[300];
    static float weight[300];
    gait_tracker_config const cfg = toy_config(1);
    for (int late = 0; late < 2; late++) {
        gait_tracker *const t = film_tracker(&cfg, 10, 1.0f);
        gait_estimate e;
        int32_t equal = 0;
        CHECK(gait_tracker_particles(t, before, weight, 300, NULL) == 300 && weight[0] == 1.0f / 300.0f);
        film_step(t, 1, 10 + late, 0, &e);
        CHECK(gait_tracker_particles(t, after, weight, 300, NULL) == 300 && weight[0] != 1.0f / 300.0f);
        for (int i = 0; i < 300; i++)
            equal += memcmp(&before[i], &after[i], sizeof *after) == 0;
        CHECK(equal == (late ? 0 : 300) && e.frame == 0 && !(e.flags & GAIT_EST_RESAMPLED));
        toy_tracker_free(t);
    }
}

/* Status of a frame at a time, and that a refusal changes nothing. */
static void refuse(gait_tracker *t, gait_frame f, gait_result want, const char *word)
{
    uint64_t const digest = gait_tracker_digest(t);
    gait_estimate e, kept;
    gait_error err = {0};
    memset(&e, 0x5a, sizeof e);
    kept = e;
    CHECK(gait_tracker_step(t, &f, &e, &err) == want && err.result == want);
    CHECK(strstr(err.text, word) != NULL);
    CHECK(gait_tracker_digest(t) == digest && memcmp(&e, &kept, sizeof e) == 0);
}

static void test_refusals(void)
{
    gait_tracker_config const cfg = toy_config(2);
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_frame f = toy_frame(10);
    gait_estimate e;
    f.image[0] = toy_image(film[0][10]);
    refuse(t, f, GAIT_ERR_STATE, "call gait_tracker_start() first");
    toy_tracker_start(t, 10, 1.0f);
    f.utime = toy_frame(9).utime;
    refuse(t, f, GAIT_ERR_STATE, "is not after");
    film_step(t, 2, 10, 0, &e);
    refuse(t, toy_frame(10), GAIT_ERR_STATE, "is not after"); /* the same again */
    refuse(t, toy_frame(9), GAIT_ERR_STATE, "is not after");
    refuse(t, toy_frame(26), GAIT_ERR_STATE, "max_dt");
    f.utime = INT64_MIN;
    refuse(t, f, GAIT_ERR_STATE, "is not after");
    f.utime = INT64_MAX;
    refuse(t, f, GAIT_ERR_STATE, "max_dt");
    gait_image const good = toy_image(film[0][11]);
    _Static_assert(SCENE_W == 384, "the texts below contain it");
    static const char *const words[] = {
        "image of camera 1 is 383 x",
        "image of camera 1 is 384 x",
        "stride 383, 384 pixels of GAIT_GREY8 take at least 384",
        "image of camera 1 has unknown format 0",
        "stride -384, 384 pixels of GAIT_GREY8 take at least 384",
        "stride 384, 384 pixels of GAIT_RGB8 or GAIT_BGR8 take at least 1152"};
    for (int k = 0; k < 6; k++) {
        gait_image bad = good;
        int32_t *const format = (int32_t *)(void *)&bad.format;
        int32_t *const number[] = {&bad.width, &bad.height, &bad.stride, format, &bad.stride, format};
        static const int32_t value[] = {SCENE_W - 1, SCENE_H + 1, SCENE_W - 1, 0, -SCENE_W, GAIT_RGB8};
        *number[k] = value[k];
        f = toy_frame(11);
        f.image[0] = good;
        f.image[1] = bad;
        refuse(t, f, GAIT_ERR_ARG, words[k]);
    }
    f = toy_frame(11);
    CHECK(gait_tracker_step(NULL, &f, &e, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_step(t, NULL, &e, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_step(t, &f, NULL, NULL) == GAIT_ERR_ARG);
    film_step(t, 2, 11, 0, &e); /* and it goes on */
    CHECK(e.frame == 1 && e.status == GAIT_TRACK_TRACKING);
    gait_state const mean = toy_walk(0.0f), sd = toy_start_sd(1.0f);
    CHECK(gait_tracker_start(t, &mean, &sd, INT64_MIN, NULL) == GAIT_OK);
    f.utime = INT64_MAX;
    refuse(t, f, GAIT_ERR_STATE, "max_dt");
    toy_tracker_free(t);
}

/* ---- track loss ---- */

/* A blank image: after a third of a second the person is lost, and the place becomes less and less certain. */
static void test_occluded(void)
{
    static uint8_t blank[SCENE_PIXELS];
    for (int plate = 0; plate < 2; plate++) {
        gait_tracker_config const cfg = toy_config(1);
        gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
        const uint8_t *const shots[SCENE_CAMERAS] = {blank, NULL};
        gait_estimate e;
        int lost_at = 0;
        if (!plate)
            CHECK(gait_tracker_set_background(t, 0, NULL, NULL) == GAIT_OK);
        memset(blank, 128, sizeof blank);
        for (int n = 0; n < 20; n++)
            film_step(t, 1, n, 0, &e);
        CHECK(e.status == GAIT_TRACK_TRACKING);
        float const sd = e.sd.pelvis[0];
        for (int n = 20; n < 60; n++) {
            toy_tracker_step(t, n, shots, &e);
            lost_at = !lost_at && e.status == GAIT_TRACK_LOST ? n : lost_at;
            CHECK(!lost_at || e.status == GAIT_TRACK_LOST);
        }
        CHECK(lost_at >= 28 && lost_at <= 34);
        CHECK(plate || e.sd.pelvis[0] > 2.0f * sd); /* with a background the empty image excludes places */
        toy_tracker_free(t);
    }
}

/* No picture at all: prediction, flagged, lost after the same time; pictures again: found again. */
static void test_no_image(void)
{
    gait_tracker_config const cfg = toy_config(2);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    gait_estimate e;
    error have = {0};
    for (int n = 0; n < 20; n++)
        film_step(t, 2, n, 0, &e);
    float const sd = e.sd.pelvis[0];
    for (int n = 20; n < 36; n++) {
        film_step(t, 2, n, 3, &e);
        check_sane(t, &e, &cfg, n);
        CHECK((e.flags & GAIT_EST_NO_IMAGE) && e.log_evidence == 0.0);
        CHECK((e.status == GAIT_TRACK_LOST) == (n >= 29)); /* 0.33 s after frame 19 */
    }
    CHECK(e.sd.pelvis[0] > 1.5f * sd && e.sd.phase > 0.0f);
    measure_error(&e, 35, &have);
    CHECK(have.across < 0.15 && have.phase < 0.04); /* half a second on its own */
    for (int n = 36; n < 46; n++)
        film_step(t, 2, n, 0, &e);
    CHECK(!(e.flags & GAIT_EST_NO_IMAGE) && e.status == GAIT_TRACK_TRACKING);
    have = (error){0};
    measure_error(&e, 45, &have);
    CHECK(have.across < 0.03 && have.phase < 0.015);
    toy_tracker_free(t);
}

/* With an unknown phase the status is not `tracking` before both hypotheses have been compared. */
static void test_unknown_phase(void)
{
    gait_tracker_config cfg = toy_config(2);
    cfg.particles = 600;
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    gait_state const mean = toy_walk(0.0f);
    gait_state sd = toy_start_sd(1.0f);
    gait_estimate e;
    error have = {0};
    sd.phase = 0.5f;
    CHECK(gait_tracker_start(t, &mean, &sd, toy_frame(0).utime, NULL) == GAIT_OK);
    for (int n = 0; n < 45; n++) {
        film_step(t, 2, n, 0, &e);
        CHECK(e.status != GAIT_TRACK_LOST && (e.status == GAIT_TRACK_INIT || n > 24));
    }
    measure_error(&e, 44, &have);
    CHECK(e.status == GAIT_TRACK_TRACKING &&
          have.phase < 0.02); /* legs and arms distinguish left from right here */
    toy_tracker_free(t);
}

/* With some particles half a stride away the status is `tracking` only if the dominant hypothesis has 70 %. */
static void test_ambiguous(void)
{
    static const struct {
        int32_t apart, seconds, status;
    } cases[] = {{25, 0, GAIT_TRACK_TRACKING},
                 {35, 0, GAIT_TRACK_INIT},
                 {35, 2, GAIT_TRACK_AMBIGUOUS},
                 {25, 2, GAIT_TRACK_TRACKING}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        gait_tracker_config cfg = toy_config(1);
        cfg.particles = 100;
        cfg.terms = GAIT_TERM_TEXTURE; /* nothing to compare with in the first frame: all weights equal */
        gait_tracker *const t = film_tracker(&cfg, 10, 0.1f);
        float *const phase = field(&t->particles, F_PHASE);
        for (int32_t i = 0; i < cases[k].apart; i++)
            phase[99 - i] = m_wrap1(phase[99 - i] + 0.5f);
        t->core->start_utime -= 1000000 * cases[k].seconds;
        gait_estimate e;
        film_step(t, 1, 10, 0, &e);
        CHECK((int32_t)e.status == cases[k].status);
        CHECK_NEAR(e.hypothesis_weight, 1.0 - 0.01 * cases[k].apart, 1e-5);
        toy_tracker_free(t);
    }
}

/* While tracking, the tracker learns the appearance of the limbs in every camera that sees them. */
static void test_appearance(void)
{
    gait_tracker_config const cfg = toy_config(2);
    gait_tracker *const t = film_tracker(&cfg, 0, 0.5f);
    int32_t known[2][2] = {{0}};
    for (int n = 0; n < 20; n++) {
        gait_estimate e;
        film_step(t, 2, n, n < 10 ? 2u : 0u, &e);
        for (int c = 0; c < 2 && (n == 9 || n == 19); c++)
            for (int i = 0; i < TOY_LIMBS * LIKE_SAMPLES; i++)
                known[n / 10][c] += t->template[0][c][i] != TEMPLATE_EMPTY;
    }
    CHECK(known[0][0] > 100 && known[0][1] == 0);
    CHECK(known[1][0] >= known[0][0] && known[1][1] > 100);
    for (int c = 0; c < 2; c++) { /* each its own */
        int32_t near = 0, both = 0;
        for (int i = 0; i < TOY_LIMBS * LIKE_HALF; i++) {
            const like_patch *const p = &t->estimate_patch[c * TOY_LIMBS + i / LIKE_HALF];
            int32_t const now = p->value[i % LIKE_HALF], point = (2 * p->turn + i % LIKE_HALF) % LIKE_SAMPLES;
            int32_t const mean = t->template[0][c][i / LIKE_HALF * LIKE_SAMPLES + point] / TEMPLATE_ONE;
            both += now != TEXTURE_HIDDEN;
            near += now != TEXTURE_HIDDEN && abs(now - mean) < 25;
        }
        CHECK(both > 80 && near > both * 3 / 4);
    }
    toy_tracker_free(t);
}

/* Resampling happens if the weights of the previous frame were uneven, and is flagged. */
static void test_resampling(void)
{
    gait_tracker_config cfg = toy_config(1);
    int flagged[3] = {0};
    cfg.silhouette_weight = cfg.edges_weight = cfg.template_weight = 2.0f;
    cfg.evidence_time = 0.0f;
    for (int k = 0; k < 3; k++) {
        cfg.resample_ess = 0.5f * (float)k;
        gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
        float before = (float)cfg.particles;
        for (int n = 0; n < 20; n++) {
            gait_estimate e;
            film_step(t, 1, n, 0, &e);
            bool const due = n > 0 && (k == 2 || before < cfg.resample_ess * (float)cfg.particles);
            CHECK(((e.flags & GAIT_EST_RESAMPLED) != 0) == due);
            flagged[k] += due;
            before = e.ess;
        }
        toy_tracker_free(t);
    }
    CHECK(flagged[0] == 0 && flagged[1] > 3 && flagged[1] < 19 && flagged[2] == 19);
}

/* Cameras at the ends of their ranges, in which nothing is seen as it is, give finite estimates. */
static void test_extreme_cameras(void)
{
    gait_tracker_config cfg = toy_config(1);
    float *const number[] = {&cfg.camera[0].fx,   &cfg.camera[0].fy,           &cfg.camera[0].cx,
                             &cfg.camera[0].cy,   &cfg.camera[0].t[0],         &cfg.camera[0].t[2],
                             &cfg.camera[0].t[2], &cfg.camera[0].distortion[4]};
    static const float end[] = {1e-3f, 1e9f, 1e6f, -1e6f, -1e4f, 1e4f, -1e4f, 1e3f};
    for (size_t k = 0; k < sizeof end / sizeof *end; k++) {
        float const kept = *number[k];
        gait_estimate e;
        *number[k] = end[k];
        gait_tracker *const t = film_tracker(&cfg, 10, 1.0f);
        for (int n = 10; n < 13; n++) {
            film_step(t, 1, n, 0, &e);
            CHECK(f_finite(e.pose.joint[0], sizeof e.pose.joint / sizeof(float)));
            CHECK(f_finite(e.joint_sd[0], sizeof e.joint_sd / sizeof(float)) && f_finite(e.mean.pelvis, 3));
            CHECK(isfinite(e.ess) && isfinite(e.log_evidence));
        }
        toy_tracker_free(t);
        *number[k] = kept;
    }
}

int main(void)
{
    film_make(SCENE_CAMERAS, 60);
    test_first_frame();
    test_refusals();
    test_occluded();
    test_no_image();
    test_unknown_phase();
    test_ambiguous();
    test_appearance();
    test_resampling();
    test_extreme_cameras();
    return CHECK_DONE();
}
