/* The tracker follows the synthetic person: seeds, cameras, colours, frame rates and modes. */
#include "tracker/tracker.h"

#include "toy_error.h"

enum { FRAMES = 60 };

/* Follow the film from a start displaced by hand; errors after the first 15 frames. */
static error follow(const gait_tracker_config *cfg, int every, uint32_t (*missing)(int n))
{
    gait_tracker *const t = film_tracker(cfg, 0, 1.0f);
    gait_state start = toy_walk(0.0f), sd = toy_start_sd(1.0f);
    error out = {0};
    gait_estimate e;
    start.phase += 0.03f;
    start.pelvis[0] += 0.03f;
    start.heading = 0.06f;
    start.stride_hz *= 1.04f;
    CHECK(gait_tracker_start(t, &start, &sd, toy_frame(0).utime, NULL) == GAIT_OK);
    for (int n = 0; n < FRAMES; n += every) {
        film_step(t, cfg->cameras, n, missing ? missing(n) : 0, &e);
        check_sane(t, &e, cfg, n / every);
        CHECK(e.utime == toy_frame(n).utime);
        out.status[e.status]++;
        if (n >= 15)
            measure_error(&e, n, &out);
    }
    toy_tracker_free(t);
    return out;
}

static void check_error(error have, double across, double depth, double phase, double joint)
{
    if (have.across > across || have.depth > depth || have.phase > phase || have.joint > joint)
        fprintf(stderr, "across %.3f m, depth %.3f m, phase %.4f, joints %.3f m\n", have.across, have.depth,
                have.phase, have.joint);
    CHECK(have.across < across && have.depth < depth && have.phase < phase && have.joint < joint);
    CHECK(have.status[GAIT_TRACK_LOST] == 0 && have.status[GAIT_TRACK_AMBIGUOUS] == 0);
}

static void test_follow(void)
{
    for (uint64_t seed = 1; seed <= 3; seed++) {
        gait_tracker_config cfg = toy_config(1);
        cfg.seed = seed;
        check_error(follow(&cfg, 1, NULL), 0.04, 0.16, 0.015, 0.05);
    }
}

static uint32_t second_now_and_then(int n)
{
    return n % 7 > 3 || (n > 30 && n < 40) ? 2u : 0u;
}

static void test_two_cameras(void)
{
    gait_tracker_config cfg = toy_config(2);
    check_error(follow(&cfg, 1, NULL), 0.02, 0.02, 0.01, 0.03);
    check_error(follow(&cfg, 1, second_now_and_then), 0.03, 0.06, 0.015, 0.04);
}

/* Two of three frames missing: 10 per second. */
static void test_slow_frames(void)
{
    gait_tracker_config cfg = toy_config(2);
    check_error(follow(&cfg, 3, NULL), 0.03, 0.03, 0.015, 0.04);
}

/* Without a background plate. */
static void test_no_plate(void)
{
    gait_tracker_config cfg = toy_config(2);
    cfg.terms = GAIT_TERM_TEXTURE | GAIT_TERM_EDGES | GAIT_TERM_TEMPLATE;
    check_error(follow(&cfg, 1, NULL), 0.03, 0.03, 0.01, 0.03);
}

/* Paper mode runs, resamples in every step, and follows the person for a while from a good start. */
static void test_paper(void)
{
    gait_tracker_config cfg = toy_config(1), own;
    gait_tracker_default(&own, GAIT_MODE_PAPER);
    cfg.mode = GAIT_MODE_PAPER;
    cfg.terms = GAIT_TERM_TEXTURE;
    cfg.texture_weight = own.texture_weight;
    cfg.resample_ess = 1.0f;
    cfg.settle_time = 0.0f;
    cfg.rate_time = cfg.tilt_time = cfg.coef_time = 0.0f;
    gait_tracker *const t = film_tracker(&cfg, 0, 0.3f);
    error have = {0};
    for (int n = 0; n < 20; n++) {
        gait_estimate e;
        film_step(t, 1, n, 0, &e);
        check_sane(t, &e, &cfg, n);
        CHECK(!(e.flags & GAIT_EST_RESAMPLED) == (n == 0));
        measure_error(&e, n, &have);
        int32_t descents = 0; /* independent draws: ancestors in no order */
        for (int32_t i = 1; i < cfg.particles; i++)
            descents += t->filter.parent[i] < t->filter.parent[i - 1];
        CHECK(n == 0 ? descents == 0 : descents > cfg.particles / 4);
    }
    CHECK(have.across < 0.15 && have.phase < 0.1);
    toy_tracker_free(t);
}

/* ---- colour ---- */

/* Frames of a tinted scene in one format. */
static void tint(int n, gait_pixel_format format, uint8_t *out)
{
    for (int32_t i = 0; i < SCENE_PIXELS; i++) {
        uint8_t const v = film[0][n][i], rgb[3] = {(uint8_t)(v / 2 + 60), v, (uint8_t)(255 - v)};
        for (int32_t c = 0; c < 3; c++)
            out[3 * i + c] = format == GAIT_GREY8 ? v : rgb[format == GAIT_BGR8 ? 2 - c : c];
    }
}

static uint64_t colour_digest(uint32_t terms, gait_pixel_format format, gait_pixel_format plate_format)
{
    static uint8_t shot[3 * SCENE_PIXELS], plate[3 * SCENE_PIXELS];
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = 100;
    cfg.terms = terms;
    gait_tracker *const t = film_tracker(&cfg, 30, 1.0f);
    gait_image image = {.data = plate, .width = SCENE_W, .height = SCENE_H, .stride = 3 * SCENE_W};
    error have = {0};
    gait_estimate e;
    tint(0, plate_format, plate); /* the person is elsewhere in frame 0 */
    image.format = plate_format == GAIT_GREY8 ? GAIT_RGB8 : plate_format;
    CHECK(gait_tracker_set_background(t, 0, &image, NULL) == GAIT_OK);
    for (int n = 30; n < 40; n++) {
        gait_frame f = toy_frame(n);
        tint(n, format, shot);
        image.data = shot;
        image.format = format == GAIT_GREY8 ? GAIT_RGB8 : format;
        f.image[0] = image;
        CHECK(gait_tracker_step(t, &f, &e, NULL) == GAIT_OK);
    }
    measure_error(&e, 39, &have);
    CHECK(have.across < 0.06 && have.phase < 0.03);
    uint64_t const digest = gait_tracker_digest(t);
    toy_tracker_free(t);
    return digest;
}

/* The order of the channels does not matter, and three equal channels are grey. */
static void test_colour(void)
{
    uint32_t const plain = GAIT_TERM_TEXTURE | GAIT_TERM_EDGES | GAIT_TERM_TEMPLATE;
    uint64_t const rgb = colour_digest(0xf, GAIT_RGB8, GAIT_RGB8);
    CHECK(colour_digest(0xf, GAIT_BGR8, GAIT_BGR8) == rgb && colour_digest(0xf, GAIT_BGR8, GAIT_RGB8) == rgb);
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = 100;
    cfg.terms = plain;
    gait_tracker *const t = film_tracker(&cfg, 30, 1.0f);
    for (int n = 30; n < 40; n++) {
        gait_estimate e;
        film_step(t, 1, n, 0, &e);
    }
    CHECK(colour_digest(plain, GAIT_GREY8, GAIT_GREY8) == gait_tracker_digest(t));
    CHECK(colour_digest(plain, GAIT_RGB8, GAIT_RGB8) != gait_tracker_digest(t));
    toy_tracker_free(t);
}

int main(void)
{
    film_make(SCENE_CAMERAS, FRAMES);
    test_follow();
    test_two_cameras();
    test_slow_frames();
    test_no_plate();
    test_paper();
    test_colour();
    return CHECK_DONE();
}
