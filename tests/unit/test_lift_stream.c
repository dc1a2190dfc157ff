/* A stream through the public interface: a body that walks through the picture is followed; starts, pauses,
 * order of time, and the same bits on every run and instruction set. */
#include "gait.h"

#include <stdbool.h>

#include "golden.h"
#include "base/hash.h"
#include "toy_lift.h"

enum { STREAM = 120, RATE = 30 };

/* Digest of the film's estimates; after a deliberate change of the lifter's numbers the one that this test prints. */
#define GOLDEN UINT64_C(0xf637f7885ec19fcd)

static gait_lift_frame out;
static double uv[TOY_MARKERS * 2], sds[TOY_MARKERS];

/* A prior in which people continue to walk: a constant pose, moved by the same amount every frame. */
static void steady_model(void)
{
    toy_segments_fill(&toy_lift_prior, 1, 0);
    for (int i = TOY_MARKERS; i < TOY_SEGMENT; i++)
        for (int a = 0; a < 3; a++) {
            int const first = i % TOY_MARKERS, frame = i / TOY_MARKERS;
            toy_lift_prior.mean[0][i][a] =
                toy_lift_prior.mean[0][first][a] + (a == 0 ? 0.03f * (float)frame : 0.0f);
            for (int k = 0; k < TOY_MODES; k++)
                toy_lift_prior.mode[0][k][i][a] = toy_lift_prior.mode[0][k][first][a];
        }
    toy_lift_load();
}

static int64_t utime_of(int frame)
{
    return 1000000 + (int64_t)frame * 1000000 / RATE;
}

/* Positions of the markers in a frame of the film: on a straight path through (0, 0), heading 0.3. */
static void body(int frame, double (*X)[3])
{
    static double segment[TOY_SEGMENT][3];
    double const since = (double)frame / RATE * (double)TOY_FPS - 40.0,
                 step = 0.03 * (double)TOY_STATURE * since;
    const double place[3] = {step * cos(0.3), step * sin(0.3), 0.01};
    toy_draw(&toy_lift_prior, 0, 21, 0.3, place, segment);
    memcpy(X, segment, TOY_MARKERS * sizeof *X);
}

/* The observations of a frame: uv and sds. */
static void see(const gait_lift_config *c, int frame, double noise)
{
    double X[TOY_MARKERS][3];
    uint32_t seed = 77u + (uint32_t)frame;
    body(frame, X);
    toy_lift_see(c, (const double (*)[3])X, TOY_MARKERS, noise, seed, uv);
    for (int j = 0; j < TOY_MARKERS; j++)
        sds[j] = toy_random(&seed) > 0.7 ? INFINITY : noise;
}

/* Push a frame; returns what the call did. */
static gait_result push(gait_lift *l, const gait_lift_config *c, int frame, double noise)
{
    see(c, frame, noise);
    return gait_lift_push(l, utime_of(frame), uv, sds, NULL);
}

static double error_of(const gait_lift_frame *f, double *worst_z)
{
    double X[TOY_MARKERS][3], sum = 0.0;
    body((int)((f->utime - 1000000) * RATE / 1000000 + ((f->utime - 1000000) * RATE % 1000000 > 500000)), X);
    for (int j = 0; j < TOY_MARKERS; j++) {
        sum += toy_distance(f->marker[j], X[j]) / TOY_MARKERS;
        for (int a = 0; a < 3; a++)
            *worst_z = fmax(*worst_z, fabs(f->marker[j][a] - X[j][a]) / f->sd[j][a]);
    }
    return sum;
}

static void test_follows(int32_t lag)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.lag = lag;
    gait_lift *const l = toy_lift_open(&c);
    int const span =
        (TOY_SEGMENT_FRAMES - 1) * RATE / (int)TOY_FPS + 1; /* frames until a first segment is whole */
    double error = 0.0, worst = 0.0;
    int count = 0;
    for (int i = 0; i < STREAM; i++) {
        CHECK(push(l, &c, i, 1.0) == GAIT_OK);
        gait_result const s = gait_lift_estimate(l, &out, NULL);
        CHECK((s == GAIT_OK) == (i >= lag));
        if (s != GAIT_OK)
            continue;
        CHECK(out.utime == utime_of(i - lag) && out.frame == (uint64_t)(i - lag));
        CHECK((out.status == GAIT_TRACK_TRACKING) == (i >= span));
        if (out.status != GAIT_TRACK_TRACKING)
            continue;
        error += error_of(&out, &worst);
        count++;
        CHECK(out.flags == 0 && out.chi2_per_observation < 3.0);
    }
    CHECK(count > STREAM - 3 * span);
    CHECK_NEAR(error / count, 0.0, 0.035);
    CHECK(worst < 6.0);
}

/* Without observations the prior continues alone, which the estimate states; a long pause starts again. */
static void test_pauses(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.lag = 0;
    gait_lift *const l = toy_lift_open(&c);
    double before = 0.0, worst = 0.0;
    for (int j = 0; j < TOY_MARKERS; j++)
        sds[j] = -1.0;
    CHECK(gait_lift_push(l, 1000, uv, sds, NULL) == GAIT_OK);
    CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_ERR_STATE); /* no person yet */
    for (int i = 0; i < 40; i++)
        CHECK(push(l, &c, i, 1.0) == GAIT_OK);
    CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_OK && out.status == GAIT_TRACK_TRACKING);
    before = out.sd[3][1];
    for (int j = 0; j < TOY_MARKERS; j++)
        sds[j] = INFINITY;
    for (int i = 40; i < 46; i++)
        CHECK(gait_lift_push(l, utime_of(i), uv, sds, NULL) == GAIT_OK);
    CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_OK && out.status == GAIT_TRACK_TRACKING);
    CHECK(out.sd[3][1] > 1.2 * before);
    for (int i = 46; i < 70; i++)
        CHECK(gait_lift_push(l, utime_of(i), uv, sds, NULL) == GAIT_OK);
    CHECK(gait_lift_estimate(l, &out, NULL) != GAIT_OK || out.status == GAIT_TRACK_INIT);
    for (int i = 90; i < STREAM; i++)
        CHECK(push(l, &c, i, 1.0) == GAIT_OK);
    CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_OK && out.status == GAIT_TRACK_TRACKING &&
          out.frame < 30);
    CHECK(error_of(&out, &worst) < 0.06);
    CHECK(push(l, &c, STREAM + 60, 1.0) == GAIT_OK); /* two seconds later */
    CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_OK && out.status == GAIT_TRACK_INIT && out.frame == 0);
}

static void test_order(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_error err = {0};
    gait_lift *l = toy_lift_open(&c);
    CHECK(push(l, &c, 3, 1.0) == GAIT_OK && push(l, &c, 3, 1.0) == GAIT_ERR_STATE);
    CHECK(gait_lift_push(l, utime_of(2), uv, NULL, &err) == GAIT_ERR_STATE &&
          strstr(err.text, "is not after") && strstr(err.text, "gait_lift_reset() begins anew"));
    CHECK(gait_lift_push(l, utime_of(4), NULL, NULL, NULL) == GAIT_ERR_ARG);
    gait_lift_reset(l);
    CHECK(push(l, &c, 0, 1.0) == GAIT_OK);
    c.lag = -1;
    l = toy_lift_open(&c);
    CHECK(push(l, &c, 0, 1.0) == GAIT_ERR_STATE && gait_lift_estimate(l, &out, NULL) == GAIT_ERR_STATE);
}

static void estimate_of(uint64_t report, uint32_t mask, gait_lift_frame *f)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.report = report;
    c.cpu_mask = mask;
    c.lag = 0;
    gait_lift *const l = toy_lift_open(&c);
    for (int i = 0; i < 20; i++)
        CHECK(push(l, &c, i, 1.0) == GAIT_OK);
    CHECK(gait_lift_estimate(l, f, NULL) == GAIT_OK);
}

/* Only the requested markers are estimated, with the same result as together with all others. */
static void test_report(void)
{
    static gait_lift_frame all;
    for (uint32_t mask = 0; mask <= 7; mask++) {
        estimate_of(~UINT64_C(0), mask, &all);
        estimate_of(0x6, mask, &out);
        CHECK(out.marker[0][2] == 0.0 && out.sd[3][0] == 0.0 && out.marker[1][2] > 0.1 && out.sd[2][1] > 0.0);
        CHECK(memcmp(out.marker[1], all.marker[1], 2 * sizeof out.marker[1]) == 0);
        CHECK(memcmp(out.sd[1], all.sd[1], 2 * sizeof out.sd[1]) == 0);
    }
}

/* Points that are far away from the first segment on are down-weighted: no estimate follows them. */
static void test_wrong_points(double off)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.lag = 5;
    gait_lift *const l = toy_lift_open(&c);
    double most = 0.0, worst = 0.0;
    int count = 0;
    for (int i = 0; i < STREAM; i++) {
        see(&c, i, 1.0);
        if (i % 7 == 3)
            for (int a = 0; a < 2; a++)
                uv[2 * (i % TOY_MARKERS) + a] += i % 2 ? off : -off;
        CHECK(gait_lift_push(l, utime_of(i), uv, sds, NULL) == GAIT_OK);
        if (gait_lift_estimate(l, &out, NULL) != GAIT_OK || out.status != GAIT_TRACK_TRACKING)
            continue;
        most = fmax(most, error_of(&out, &worst));
        count++;
    }
    CHECK(count > STREAM / 2);
    CHECK(most < 0.1 && worst < 6.0);
}

/* Points at 0, 0 or -1, -1 are missing points. */
static void test_zeros(void)
{
    static gait_lift_frame other;
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    for (int zeros = 0; zeros < 2; zeros++) {
        gait_lift *const l = toy_lift_open(&c);
        for (int i = 0; i < STREAM; i++) {
            see(&c, i, 1.0);
            int const j = i % TOY_MARKERS;
            uv[2 * j] = uv[2 * j + 1] = !zeros ? NAN : i % 2 ? 0.0 : -1.0;
            CHECK(gait_lift_push(l, utime_of(i), uv, sds, NULL) == GAIT_OK);
        }
        CHECK(gait_lift_estimate(l, zeros ? &out : &other, NULL) == GAIT_OK);
    }
    CHECK(memcmp(&out, &other, sizeof out) == 0);
}

/* Noise that is four times as large as stated widens the standard deviations by the same factor. */
static void test_noise(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    double sd[2] = {0.0};
    for (int loud = 0; loud < 2; loud++) {
        gait_lift *const l = toy_lift_open(&c);
        for (int i = 0; i < STREAM; i++) {
            see(&c, i, loud ? 4.0 : 1.0);
            for (int j = 0; j < TOY_MARKERS; j++)
                sds[j] = isfinite(sds[j]) ? 1.0 : sds[j];
            CHECK(gait_lift_push(l, utime_of(i), uv, sds, NULL) == GAIT_OK);
            if (gait_lift_estimate(l, &out, NULL) == GAIT_OK && out.status == GAIT_TRACK_TRACKING)
                sd[loud] += out.sd[3][1] / STREAM;
        }
        CHECK(loud ? out.chi2_per_observation > 4.0 : out.chi2_per_observation < 2.0);
    }
    CHECK(sd[1] > 2.0 * sd[0] && sd[1] < 4.0 * sd[0]);
}

/* A segment that does not fit starts a new search: another person walks the other way. */
static void test_poor_fit(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.lag = 0;
    c.fit_threshold = 4.0;
    c.sd = 0.5;
    gait_lift *const l = toy_lift_open(&c);
    double X[TOY_MARKERS][3];
    int flagged = 0;
    for (int i = 0; i < STREAM; i++) {
        body(i, X);
        for (int j = 0; i >= 60 && j < TOY_MARKERS; j++) /* turned about by half a turn */
            for (int a = 0; a < 2; a++)
                X[j][a] = -X[j][a];
        toy_lift_see(&c, (const double (*)[3])X, TOY_MARKERS, 0.5, (uint32_t)i, uv);
        CHECK(gait_lift_push(l, utime_of(i), uv, NULL, NULL) == GAIT_OK);
        CHECK(i < 20 || gait_lift_estimate(l, &out, NULL) == GAIT_OK);
        flagged += (out.flags & GAIT_LIFT_POOR_FIT) != 0;
        CHECK(i < 20 || (out.status == GAIT_TRACK_AMBIGUOUS) == ((out.flags & GAIT_LIFT_POOR_FIT) != 0));
    }
    CHECK(flagged > 0 && out.status == GAIT_TRACK_TRACKING);
    for (int j = 0; j < TOY_MARKERS; j++)
        CHECK(toy_distance(out.marker[j], X[j]) < 0.1);
}

/* The person is found though most points of the first second are wrong. */
static void test_clutter(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.lag = 0;
    gait_lift *const l = toy_lift_open(&c);
    uint32_t seed = 5;
    double worst = 0.0;
    for (int i = 0; i < STREAM; i++) {
        see(&c, i, 1.0);
        for (int j = 0; i < 30 && j < TOY_MARKERS; j++)
            if (toy_random(&seed) < 0.6)
                for (int a = 0; a < 2; a++)
                    uv[2 * j + a] = 480.0 * toy_random(&seed);
        CHECK(gait_lift_push(l, utime_of(i), uv, sds, NULL) == GAIT_OK);
    }
    CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_OK && out.status == GAIT_TRACK_TRACKING);
    CHECK(error_of(&out, &worst) < 0.05);
}

/* A heading that is known is not turned with the body. */
static void test_known_heading(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.lag = 0;
    c.heading = 0.3;
    c.heading_sd = 0.0;
    gait_lift *const l = toy_lift_open(&c);
    double worst = 0.0;
    for (int i = 0; i < STREAM; i++)
        CHECK(push(l, &c, i, 1.0) == GAIT_OK);
    CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_OK && out.status == GAIT_TRACK_TRACKING);
    CHECK(error_of(&out, &worst) < 0.05);
    CHECK_NEAR(out.heading, 0.3, 1e-12);
}

/* Of two ways to walk, the one that the points show is followed, whichever comes first in the model. */
static void test_second_component(void)
{
    static toy_segments kept;
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    double X[TOY_MARKERS][3];
    kept = toy_lift_prior;
    toy_lift_learn(2, 0);
    for (int of = 0; of < 2; of++) {
        gait_lift *const l = toy_lift_open(&c);
        double const place[3] = {0.0, 0.0, 0.01};
        static double segment[TOY_SEGMENT][3];
        toy_draw(&toy_lift_prior, of, 21, 0.3, place, segment);
        for (int i = 0; i < 60; i++) {
            memcpy(X, segment[i / 3 % TOY_SEGMENT_FRAMES * TOY_MARKERS], sizeof X);
            toy_lift_see(&c, (const double (*)[3])X, TOY_MARKERS, 0.5, (uint32_t)i, uv);
            CHECK(gait_lift_push(l, utime_of(i), uv, NULL, NULL) == GAIT_OK);
        }
        CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_OK && out.status != GAIT_TRACK_INIT);
    }
    toy_lift_prior = kept;
    toy_lift_load();
}

/* A point with an sd whose square is too small for a double, in any frame: where that is an error the stream begins anew, and
 * the person is found again. */
static void test_out_of_range(double tiny, double threshold)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.residual = 0.0;
    c.lag = 0;
    c.fit_threshold = threshold;
    gait_lift *const l = toy_lift_open(&c);
    int refused = 0;
    double worst = 0.0;
    for (int at = 0; at < 40; at++) {
        gait_lift_reset(l);
        for (int i = 0; i < 60; i++) {
            see(&c, i, 1.0);
            if (i == at)
                for (int j = 0; j < TOY_MARKERS; j++)
                    sds[j] = tiny;
            gait_result const s = gait_lift_push(l, utime_of(i), uv, sds, NULL);
            CHECK(s == GAIT_OK || s == GAIT_ERR_NUMERIC);
            if (s == GAIT_OK)
                continue;
            refused++;
            CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_ERR_STATE);
        }
    }
    CHECK(refused > 0);
    gait_lift_reset(l);
    for (int i = 0; i < 60; i++)
        CHECK(push(l, &c, i, 1.0) == GAIT_OK);
    CHECK(gait_lift_estimate(l, &out, NULL) == GAIT_OK && error_of(&out, &worst) < 0.1);
}

/* A person without size, one point of which is seen far more exactly than rounding: an estimate is finite, or there is none. */
static void test_absurd(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_ORTHOGRAPHIC);
    c.stature = 1e-38;
    c.stature_sd = -1.0;
    c.heading_sd = 0.3;
    c.place_sd[0] = 22.55;
    gait_lift *const l = toy_lift_open(&c);
    int refused = 0;
    for (int i = 0; i < 20; i++) {
        double sum = 0.0;
        for (int j = 0; j < TOY_MARKERS; j++) {
            uv[2 * j] = j == 5 ? 1e-38 : 24.0 + j % 7;
            uv[2 * j + 1] = j == 5 ? 1e-38 : 8.0 + j % 13;
            sds[j] = j == 5 ? (i == 3 ? 1e-50 : 1e-38) : 2.0;
        }
        gait_result const pushed = gait_lift_push(l, 1 + 50000 * (int64_t)(i + 1), uv, sds, NULL);
        CHECK(pushed == GAIT_OK || pushed == GAIT_ERR_NUMERIC);
        gait_result const s = gait_lift_estimate(l, &out, NULL);
        for (int k = 0; k < 3 * TOY_MARKERS; k++)
            sum += fabs(out.marker[k / 3][k % 3]) + fabs(out.sd[k / 3][k % 3]);
        CHECK(s == GAIT_ERR_STATE || (s == GAIT_OK) == (bool)isfinite(sum));
        refused += s == GAIT_ERR_NUMERIC;
    }
    CHECK(refused > 0);
}

/* Hash of every estimate of the film. */
static uint64_t digest(uint32_t mask)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.lag = 4;
    c.cpu_mask = mask;
    gait_lift *const l = toy_lift_open(&c);
    uint64_t h = HASH_INIT;
    for (int i = 0; i < STREAM; i++) {
        (void)push(l, &c, i, 1.0);
        if (gait_lift_estimate(l, &out, NULL) == GAIT_OK)
            h = hash_fnv1a(h, &out, sizeof out);
    }
    return h;
}

static void tests(void)
{
    test_follows(0);
    test_follows(5);
    test_follows(20);
    test_pauses();
    test_order();
    test_report();
    test_poor_fit();
    test_clutter();
    test_known_heading();
    test_second_component();
    test_absurd();
    test_out_of_range(1e-200, 9.0);
    test_out_of_range(1e-153, 0.0);
    test_noise();
    for (double off = 50.0; off < 1e31; off *= 10.0)
        test_wrong_points(off);
    test_zeros();
}

int main(int argc, char **argv)
{
    steady_model();
    return golden_main(argc, argv, tests, digest, GOLDEN, "stream");
}
