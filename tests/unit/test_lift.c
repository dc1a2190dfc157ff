/* One segment through the public interface: bodies drawn from the prior are found again, with honest
 * standard deviations. The algebra itself is compared with numpy's in tests/python/test_lifter.py. */
#include "gait.h"

#include <float.h>
#include <stdbool.h>

#include "toy_lift.h"

static double X[TOY_SEGMENT][3], uv[TOY_SEGMENT * 2], mean[TOY_SEGMENT * 3], sd[TOY_SEGMENT * 3];
static double sds[TOY_SEGMENT];

static void set_all_sds(double value)
{
    for (int i = 0; i < TOY_SEGMENT; i++)
        sds[i] = value;
}

static double largest_error(void)
{
    double largest = 0.0;
    for (int i = 0; i < TOY_SEGMENT; i++)
        largest = fmax(largest, toy_distance(mean + 3 * i, X[i]));
    return largest;
}

/* Without noise the body is found, whatever its heading and position. */
static void test_exact(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.residual = 0.0; /* the draws have none */
    gait_lift *const l = toy_lift_open(&c);
    set_all_sds(0.02);
    for (int k = 0; k < 6; k++) {
        double const heading = 1.1 * k, place[3] = {0.4 * k - 1.0, 0.5 * k - 1.0, 0.02};
        gait_lift_fit fit;
        toy_draw(&toy_lift_prior, 0, (uint32_t)k, heading, place, X);
        toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 0.0, 1, uv);
        CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK && fit.converged);
        CHECK(gait_lift_positions(l, mean, sd, NULL) == GAIT_OK);
        CHECK_NEAR(largest_error(), 0.0, 5e-3);
        CHECK_NEAR(cos(fit.heading - heading), 1.0, 1e-4);
        CHECK_NEAR(fit.place[0], place[0], 1e-2);
        CHECK_NEAR(fit.place[1], place[1], 1e-2);
        CHECK(fit.observed == 2 * TOY_SEGMENT && fit.share == 1.0 && fit.log10_volume < -3.0);
        CHECK(fit.heading_sd > 0.0 && fit.heading_sd < 0.05);
    }
}

/* Drawn from the prior: errors have the standard deviations that are reported (chi-square, 90 % interval). */
static void test_coverage(int projection, double noise)
{
    gait_lift_config c = toy_lift_config(projection);
    c.heading_sd = 0.0;
    c.residual = 0.0;
    c.place_sd[1] = 0.3;
    gait_lift *const l = toy_lift_open(&c);
    double square = 0.0;
    int within = 0, count = 0;
    set_all_sds(noise);
    for (uint32_t k = 0; k < 200; k++) {
        uint32_t seed = 1000 + k;
        double z[4];
        for (int i = 0; i < 4; i++) { /* near enough to normal */
            z[i] = 0.0;
            for (int n = 0; n < 12; n++)
                z[i] += 0.5 * toy_random(&seed);
        }
        const double place[3] = {0.3 * z[0], 0.3 * z[1], 0.05 * z[2]};
        gait_lift_fit fit;
        toy_draw(&toy_lift_prior, 0, seed, 0.0, place, X);
        toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, noise, seed + 1, uv);
        CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
        CHECK(gait_lift_positions(l, mean, sd, NULL) == GAIT_OK);
        for (int i = 0; i < 3 * TOY_SEGMENT; i++) {
            double const e = (mean[i] - X[i / 3][i % 3]) / sd[i];
            square += e * e;
            within += fabs(e) < 1.645;
            count++;
        }
    }
    /* toy_draw's alphas are uniform with a variance of 0.75: a little less than in the prior */
    CHECK_NEAR(square / count, 0.97, 0.12);
    CHECK_NEAR((double)within / count, 0.905, 0.03);
}

/* Points whose sd marks them as unobserved are not read, and leave more uncertainty. */
static void test_missing(void)
{
    gait_lift_config const c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_lift *const l = toy_lift_open(&c);
    const double place[3] = {0.1, 0.2, 0.0};
    double all_sd = 0.0, some_sd = 0.0;
    gait_lift_fit fit;
    toy_draw(&toy_lift_prior, 0, 5, 0.4, place, X);
    toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 1.0, 3, uv);
    set_all_sds(1.0);
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK &&
          gait_lift_positions(l, mean, sd, NULL) == GAIT_OK);
    for (int i = 0; i < 3 * TOY_SEGMENT; i++)
        all_sd += sd[i];
    for (int i = 0; i < TOY_SEGMENT; i += 3)
        sds[i] = i % 2 ? INFINITY : i % 4 ? NAN : -1.0;
    uv[2 * 3] = uv[2 * 6 + 1] = NAN;
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK &&
          gait_lift_positions(l, mean, sd, NULL) == GAIT_OK);
    CHECK(fit.observed == 2 * (TOY_SEGMENT - TOY_SEGMENT / 3) && largest_error() < 0.2);
    for (int i = 0; i < 3 * TOY_SEGMENT; i++)
        some_sd += sd[i];
    CHECK(some_sd > 1.05 * all_sd && some_sd < 3.0 * all_sd);
    for (int i = 0; i < TOY_SEGMENT; i++)
        sds[i] = INFINITY;
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK && fit.observed == 0);
    CHECK_NEAR(fit.log10_volume, 0.0, 1e-12);
    CHECK_NEAR(fit.log_evidence, 0.0, 1e-12);
}

/* Positions are in the prior's order, whichever markers a stream reports. */
static void test_report(void)
{
    static double each[2][2][TOY_SEGMENT * 3];
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    const double place[3] = {0.1, 0.2, 0.0};
    gait_lift_fit fit;
    toy_draw(&toy_lift_prior, 0, 5, 0.4, place, X);
    toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 1.0, 3, uv);
    set_all_sds(1.0);
    for (int k = 0; k < 2; k++) {
        c.report = k == 0 ? ~UINT64_C(0) : 5u << (TOY_MARKERS - 3);
        gait_lift *const l = toy_lift_open(&c);
        CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
        CHECK(gait_lift_positions(l, each[k][0], each[k][1], NULL) == GAIT_OK);
    }
    CHECK(memcmp(each[0], each[1], sizeof each[0]) == 0);
}

/* The component that made a body explains it. */
static void test_mixture(void)
{
    toy_lift_learn(2, 0);
    gait_lift_config const c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_lift *const l = toy_lift_open(&c);
    set_all_sds(1.0);
    for (int k = 0; k < 6; k++) {
        const double place[3] = {0.2, 0.1, 0.0};
        gait_lift_fit fit;
        toy_draw(&toy_lift_prior, k % 2, (uint32_t)k, 0.7 * k, place, X);
        toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 1.0, 9, uv);
        CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
        CHECK(fit.component == k % 2 && fit.share > 0.9 && fit.share <= 1.0);
    }
    toy_lift_learn(1, 0);
}

/* Many segments at once give the same as each alone, also where the stature is unknown. */
static void test_batch(double stature_sd)
{
    enum { MANY = 3 };
    static double many[MANY][TOY_SEGMENT * 2], batch[MANY][TOY_SEGMENT * 3];
    gait_lift_config c = toy_lift_config(GAIT_LIFT_ORTHOGRAPHIC);
    c.heading = 0.9;
    c.heading_sd = 0.0;
    c.stature_sd = stature_sd;
    gait_lift *const l = toy_lift_open(&c);
    const double place[3] = {0.5, -0.2, 0.01};
    gait_lift_fit fit;
    CHECK(gait_lift_batch(l, 1, many[0], batch[0], NULL) == GAIT_ERR_STATE);
    set_all_sds(0.02);
    for (int i = 0; i < TOY_SEGMENT; i += 5)
        sds[i] = i % 2 ? INFINITY : -1.0;
    for (uint32_t k = 0; k < MANY; k++) {
        toy_draw(&toy_lift_prior, 0, 40 + k, c.heading, place, X);
        toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 0.02, k, many[k]);
    }
    CHECK(gait_lift_fix(l, sds, NULL) == GAIT_OK &&
          gait_lift_batch(l, MANY, many[0], batch[0], NULL) == GAIT_OK);
    for (int k = 0; k < MANY; k++) {
        CHECK(gait_lift_segment(l, many[k], sds, &fit, NULL) == GAIT_OK);
        CHECK(gait_lift_positions(l, mean, sd, NULL) == GAIT_OK);
        for (int i = 0; i < 3 * TOY_SEGMENT; i++)
            CHECK_NEAR(batch[k][i], mean[i], stature_sd > 0.0 ? 0.05 : 1e-12); /* products of unknowns */
    }
    c.heading_sd = -1.0;
    CHECK(gait_lift_fix(toy_lift_open(&c), sds, NULL) == GAIT_ERR_STATE);
}

/* An orthographic view does not determine depth: the least certain displacement is along it. */
static void test_uncertain(void)
{
    static double mode[2][TOY_SEGMENT][3];
    gait_lift_config c = toy_lift_config(GAIT_LIFT_ORTHOGRAPHIC);
    c.heading_sd = 0.0;
    gait_lift *const l = toy_lift_open(&c);
    const double place[3] = {0.0};
    double mode_sd[2], along = 0.0, all = 0.0;
    gait_lift_fit fit;
    CHECK(gait_lift_uncertain(l, 2, mode[0][0], mode_sd, NULL) == GAIT_ERR_STATE);
    toy_draw(&toy_lift_prior, 0, 2, 0.0, place, X);
    toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 0.01, 1, uv);
    set_all_sds(0.01);
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
    CHECK(gait_lift_uncertain(l, 2, mode[0][0], mode_sd, NULL) == GAIT_OK);
    for (int i = 0; i < TOY_SEGMENT; i++)
        for (int a = 0; a < 3; a++) {
            along += a == 1 ? mode[0][i][a] * mode[0][i][a] : 0.0;
            all += mode[0][i][a] * mode[0][i][a];
        }
    CHECK(along > 0.9999 * all && mode_sd[0] > mode_sd[1]);
    CHECK_NEAR(sqrt(all), mode_sd[0], 1e-9 * mode_sd[0]);
    CHECK_NEAR(mode_sd[0], 10.0 * sqrt(TOY_SEGMENT), 0.1);
    for (uint32_t seed = 3; seed < 20;
         seed++) { /* the sign is that which makes the largest number positive */
        toy_draw(&toy_lift_prior, 0, seed, 0.0, place, X);
        toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 0.01, seed, uv);
        for (int i = 0; i < TOY_SEGMENT; i++)
            sds[i] = i % (int)seed ? 0.01 : INFINITY;
        CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
        CHECK(gait_lift_uncertain(l, 2, mode[0][0], mode_sd, NULL) == GAIT_OK);
        for (int m = 0; m < 2; m++) {
            double largest = 0.0;
            for (int i = 0; i < 3 * TOY_SEGMENT; i++)
                largest = fabs(mode[m][i / 3][i % 3]) > fabs(largest) ? mode[m][i / 3][i % 3] : largest;
            CHECK(largest > 0.0);
        }
    }
    CHECK(gait_lift_uncertain(l, gait_lift_unknowns(l) + 1, mode[0][0], sd, NULL) == GAIT_ERR_ARG);
}

/* The scale is 1 without evidence about the modes, and grows with how far the motion is from the mean. */
static void test_scale(void)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_ORTHOGRAPHIC);
    c.heading_sd = 0.0;
    gait_lift *const l = toy_lift_open(&c);
    const double place[3] = {0.0};
    double last = 0.0;
    gait_lift_fit fit;
    CHECK(gait_lift_scale(l, &last, NULL) == GAIT_ERR_STATE &&
          gait_lift_scale(NULL, &last, NULL) == GAIT_ERR_ARG);
    for (int far = 0; far < 4; far++) {
        toy_draw(&toy_lift_prior, 0, 2, 0.0, place, X);
        for (int i = 0; i < TOY_SEGMENT; i++)
            for (int a = 0; a < 3; a++) {
                double const middle = (double)toy_lift_prior.mean[0][i][a] * (double)TOY_STATURE;
                X[i][a] = middle + far * (X[i][a] - middle);
            }
        toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 0.001, 1, uv);
        set_all_sds(0.001);
        CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
        double scale = 0.0;
        CHECK(gait_lift_scale(l, &scale, NULL) == GAIT_OK && scale > last);
        last = scale;
        CHECK(far > 0 || last < 1.0);
    }
    CHECK(last > 1.0);
    set_all_sds(INFINITY);
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
    CHECK(gait_lift_scale(l, &last, NULL) == GAIT_OK);
    CHECK_NEAR(last, 1.0, 1e-12);
    CHECK(gait_lift_fix(l, sds, NULL) == GAIT_OK);
    CHECK(gait_lift_scale(l, &last, NULL) == GAIT_ERR_STATE); /* a gain has no motion */
}

/* A point 80 pixels off moves a fit, and hardly moves a robust one, which gives it a larger standard deviation. */
static void test_robust(void)
{
    static double weighted[TOY_SEGMENT];
    gait_lift_config const c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_lift *const l = toy_lift_open(&c);
    double const place[3] = {0.2, 0.1, 0.0};
    double error[2];
    gait_lift_fit fit;
    set_all_sds(2.0);
    toy_draw(&toy_lift_prior, 0, 4, 0.3, place, X);
    toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 1.0, 4, uv);
    uv[2 * 13] += 80.0;
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
    CHECK(gait_lift_positions(l, mean, NULL, NULL) == GAIT_OK);
    error[0] = toy_distance(mean + 3 * 13, X[13]);
    CHECK(gait_lift_segment_robust(l, uv, sds, weighted, &fit, NULL) == GAIT_OK);
    CHECK(gait_lift_positions(l, mean, NULL, NULL) == GAIT_OK);
    error[1] = toy_distance(mean + 3 * 13, X[13]);
    CHECK(error[1] < 0.5 * error[0]);
    for (int i = 0; i < TOY_SEGMENT; i++)
        CHECK(i == 13 ? weighted[i] > 4.0 * sds[i] : weighted[i] >= sds[i] && weighted[i] < 2.0 * sds[i]);
}

/* Unobserved, the person is where they are expected and the unknowns have their prior; observed, less is unknown. */
static void test_expected_and_unknown(void)
{
    enum { N = TOY_MODES + 4 };
    static double theta[N], covariance[N * N];
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    double const place[3] = {1.5, -0.5, 0.0};
    gait_lift_fit fit;
    gait_lift *l = toy_lift_open(&c);
    CHECK(gait_lift_expect(l, place, 0.7, 0.0, NULL) == GAIT_ERR_ARG);
    CHECK(gait_lift_expect(l, place, 0.7, -0.5, NULL) == GAIT_ERR_ARG);
    CHECK(gait_lift_expect(l, place, 0.7, 0.2, NULL) == GAIT_OK && gait_lift_unknowns(l) == N);
    set_all_sds(-1.0);
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK && fit.observed == 0);
    CHECK_NEAR(fit.place[0], 1.5, 1e-9);
    CHECK_NEAR(fit.place[1], -0.5, 1e-9);
    CHECK_NEAR(fit.heading, 0.7, 1e-9);
    CHECK(gait_lift_posterior(l, theta, covariance, NULL) == GAIT_OK);
    for (int i = 0; i < N * N; i++)
        CHECK_NEAR(covariance[i], i % (N + 1) == 0, 1e-9);
    set_all_sds(2.0);
    toy_draw(&toy_lift_prior, 0, 2, 0.7, place, X);
    toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 1.0, 2, uv);
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
    CHECK(gait_lift_posterior(l, theta, covariance, NULL) == GAIT_OK);
    for (int i = 0; i < N; i++) {
        CHECK(covariance[i * (N + 1)] > 0.0 && covariance[i * (N + 1)] < 0.5);
        for (int k = 0; k < i; k++)
            CHECK_NEAR(covariance[i * N + k], covariance[k * N + i], 1e-9);
    }
    CHECK(gait_lift_posterior(l, theta, NULL, NULL) == GAIT_OK);
    c.heading_sd = 0.2; /* the heading is known */
    l = toy_lift_open(&c);
    CHECK(gait_lift_expect(l, place, 0.7, 0.2, NULL) == GAIT_ERR_STATE);
}

/* A person without size, seen with errors that are far below rounding: an answer is finite, or there is none. */
static void test_absurd(void)
{
    static const double tiny[] = {1e-10, 1e-38, 1e-100, 1e-200, 1e-300};
    static double x[TOY_SEGMENT * 3], e[TOY_SEGMENT * 3], weighted[TOY_SEGMENT];
    int refused = 0;
    for (size_t k = 0; k < sizeof tiny / sizeof *tiny; k++)
        for (int robust = 0; robust < 2; robust++) {
            gait_lift_config c = toy_lift_config(GAIT_LIFT_ORTHOGRAPHIC);
            gait_lift_fit fit;
            double scale = 1.0, finite = 0.0;
            c.stature = 1e-38;
            c.heading_sd = 0.0;
            gait_lift *const l = toy_lift_open(&c);
            for (int i = 0; i < TOY_SEGMENT; i++) {
                uv[2 * i] = 24.0 + i % 7;
                uv[2 * i + 1] = 8.0 + i % 13;
                sds[i] = i % 3 ? 2.0 : tiny[k];
            }
            gait_result const found = robust ? gait_lift_segment_robust(l, uv, sds, weighted, &fit, NULL)
                                             : gait_lift_segment(l, uv, sds, &fit, NULL);
            gait_result const read = gait_lift_positions(l, x, e, NULL);
            gait_result const scaled = gait_lift_scale(l, &scale, NULL);
            for (int i = 0; i < 3 * TOY_SEGMENT; i++)
                finite += x[i] - x[i] + (e[i] - e[i]);
            CHECK(read != GAIT_OK || finite == 0.0);
            CHECK(scaled != GAIT_OK || (scale > 0.0 && scale <= DBL_MAX));
            refused += (read == GAIT_ERR_NUMERIC) + (scaled == GAIT_ERR_NUMERIC);
            CHECK(found == GAIT_OK && gait_lift_fix(l, sds, NULL) == GAIT_OK);
            CHECK(gait_lift_positions(l, x, e, NULL) == (k ? GAIT_ERR_NUMERIC : GAIT_OK));
        }
    CHECK(refused > 2);
}

/* Without an error of its own the model takes any sd: one whose square is too small for a double is an error, wherever in
 * the search that shows, and the next segment is found again. */
static void test_out_of_range(int projection, double heading_sd)
{
    gait_lift_config c = toy_lift_config(projection);
    gait_lift_fit fit;
    double const place[3] = {0.1, 0.2, 0.02};
    double scale, weighted[TOY_SEGMENT];
    int refused = 0;
    c.residual = 0.0;
    c.heading_sd = heading_sd;
    gait_lift *const l = toy_lift_open(&c);
    toy_draw(&toy_lift_prior, 0, 3, 0.0, place, X);
    toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 1.0, 1, uv);
    for (int k = 1400; k < 1640; k += 5) {
        set_all_sds(pow(10.0, -0.1 * k));
        gait_result const usual = gait_lift_segment(l, uv, sds, &fit, NULL);
        CHECK(usual == GAIT_OK || usual == GAIT_ERR_NUMERIC);
        CHECK((gait_lift_scale(l, &scale, NULL) == GAIT_ERR_STATE) == (usual != GAIT_OK));
        CHECK((gait_lift_positions(l, mean, NULL, NULL) == GAIT_ERR_STATE) == (usual != GAIT_OK));
        gait_result const robust = gait_lift_segment_robust(l, uv, sds, weighted, &fit, NULL);
        CHECK(robust == GAIT_OK || robust == GAIT_ERR_NUMERIC);
        refused += (usual == GAIT_ERR_NUMERIC) + (robust == GAIT_ERR_NUMERIC);
        gait_result const gain = gait_lift_fix(l, sds, NULL);
        CHECK(gain == (heading_sd != 0.0 ? GAIT_ERR_STATE : usual));
        CHECK((gait_lift_batch(l, 1, uv, mean, NULL) == GAIT_OK) == (gain == GAIT_OK));
    }
    CHECK(refused > 2);
    set_all_sds(1.0);
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
}

/* Least squares find an exact body again, whatever is fitted beside its modes. */
static void test_least_squares(double heading_sd)
{
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_lift_fit fit;
    double const place[3] = {0.1, 0.2, 0.02};
    c.residual = 0.0;
    c.heading = 0.3;
    c.heading_sd = heading_sd;
    gait_lift *const l = toy_lift_open(&c);
    toy_draw(&toy_lift_prior, 0, 3, 0.3, place, X);
    toy_lift_see(&c, (const double (*)[3])X, TOY_SEGMENT, 0.0, 1, uv);
    set_all_sds(0.02);
    CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
    CHECK(gait_lift_least_squares(l, mean, NULL) == GAIT_OK);
    CHECK_NEAR(largest_error(), 0.0, 0.02);
}

/* A stature that is stated may be wrong by 4 cm, one that is not by 9 cm. */
static void test_stature(void)
{
    double sd_of[2];
    for (int known = 0; known < 2; known++) {
        gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
        gait_lift_fit fit;
        c.stature_sd = -1.0;
        c.stature = known ? (double)TOY_STATURE : 0.0;
        gait_lift *const l = toy_lift_open(&c);
        set_all_sds(INFINITY);
        CHECK(gait_lift_segment(l, uv, sds, &fit, NULL) == GAIT_OK);
        CHECK(gait_lift_positions(l, mean, sd, NULL) == GAIT_OK);
        sd_of[known] = sd[3 * 3 + 2];
    }
    double const height =
        mean[3 * 3 + 2] / (double)TOY_STATURE; /* of a shoulder, as a share of the stature */
    CHECK_NEAR(sd_of[0] * sd_of[0] - sd_of[1] * sd_of[1], height * height * (0.09 * 0.09 - 0.04 * 0.04),
               1e-5);
}

/* Every call refuses missing arguments. */
static void test_nothing(void)
{
    gait_lift_config const c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_lift *const l = toy_lift_open(&c);
    gait_lift_info info;
    gait_lift_fit fit;
    gait_lift_frame frame;
    double x[3] = {0.0};
    size_t bytes = 0;
    gait_lift_default(NULL);
    gait_lift_reset(NULL);
    for (int k = 0; k < 2; k++) { /* without a lifter, and without a place for the answer or an argument */
        gait_lift *const at = k ? l : NULL;
        double *const to = k ? NULL : x;
        CHECK(gait_lift_segment(at, to, sds, &fit, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_segment(at, x, NULL, k ? NULL : &fit, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_segment_robust(at, x, NULL, to, &fit, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_segment_robust(at, to, NULL, x, &fit, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_segment_robust(at, x, NULL, x, k ? NULL : &fit, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_expect(at, to, 0.0, 0.1, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_positions(at, to, NULL, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_posterior(at, to, NULL, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_scale(at, to, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_least_squares(at, to, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_uncertain(at, 1, to, x, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_uncertain(at, 1, x, to, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_fix(at, to, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_batch(at, 1, to, x, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_batch(at, 1, x, to, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_push(at, 1, to, NULL, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_estimate(at, k ? NULL : &frame, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_get_info(k ? toy_lift_model : NULL, k ? NULL : &info, NULL) == GAIT_ERR_ARG);
        CHECK(gait_lift_bytes(toy_lift_model, k ? &c : NULL, k ? NULL : &bytes, NULL) == GAIT_ERR_ARG);
    }
    for (int k = 0; k < 4; k++) { /* without one of the arrays */
        double *const a[4] = {k == 0 ? NULL : x, k == 1 ? NULL : x, k == 2 ? NULL : x, k == 3 ? NULL : x};
        CHECK(gait_lift_remove_spikes(1, 1, a[0], a[1], a[2], a[3]) == 0);
        CHECK(gait_lift_weight_outliers(k < 3, a[0], a[1], a[2]) == 0);
        CHECK(gait_lift_weight_outliers(-1, x, x, x) == 0);
    }
    CHECK(gait_lift_unknowns(NULL) == GAIT_ERR_ARG && !gait_lift_marker_name(NULL, 0));
}

/* A config from an older header, which lacks the later settings: they have their defaults. */
static void test_an_older_config(void)
{
    enum { OLDER = offsetof(gait_lift_config, report) };
    gait_lift_config cut, full = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_lift_config const set = full;
    gait_lift_fit fit[2];
    set_all_sds(0.02);
    memset(&cut, 0xff, sizeof cut);
    gait_lift_fill(&cut, OLDER);
    CHECK(cut.struct_size == OLDER && isnan(cut.residual)); /* nothing is written past its end */
    gait_lift_default(&full);
    memcpy(&full, &set, OLDER);
    full.struct_size = sizeof full;
    memcpy(&cut, &full, OLDER);
    cut.struct_size = OLDER;
    toy_draw(&toy_lift_prior, 0, 1, 0.3, (double[]){0.4, 0.5, 0.02}, X);
    toy_lift_see(&full, (const double (*)[3])X, TOY_SEGMENT, 0.0, 1, uv);
    CHECK(gait_lift_segment(toy_lift_open(&full), uv, sds, &fit[0], NULL) == GAIT_OK);
    CHECK(gait_lift_segment(toy_lift_open(&cut), uv, sds, &fit[1], NULL) == GAIT_OK);
    CHECK(memcmp(&fit[0], &fit[1], sizeof fit[0]) == 0);
}

static void test_arguments(void)
{
    gait_lift_config const good = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_lift *l = NULL;
    gait_error err = {0};
    gait_lift_fit fit;
    size_t bytes = 0;
    CHECK(gait_lift_bytes(toy_lift_model, &good, &bytes, NULL) == GAIT_OK && bytes > 1000);
    CHECK(gait_lift_init(toy_lift_memory, bytes - 1, toy_lift_model, &good, &l, &err) == GAIT_ERR_MEMORY);
    CHECK(gait_lift_init(toy_lift_memory + 8, bytes, toy_lift_model, &good, &l, &err) == GAIT_ERR_MEMORY);
    CHECK(gait_lift_bytes(NULL, &good, &bytes, &err) == GAIT_ERR_ARG && !l);
    CHECK(gait_lift_segment(NULL, uv, NULL, &fit, NULL) == GAIT_ERR_ARG);
    for (int i = 0; i < 4; i++)
        CHECK(gait_lift_init(i == 0 ? NULL : toy_lift_memory, bytes, i == 1 ? NULL : toy_lift_model,
                             i == 2 ? NULL : &good, i == 3 ? NULL : &l, NULL) == GAIT_ERR_ARG);
    enum { BAD = 24 };
    gait_lift_config bad[BAD];
    for (int i = 0; i < BAD; i++)
        bad[i] = good;
    bad[0].projection = 2;
    bad[1].stature = -1;
    bad[2].sd = 0;
    bad[3].residual = NAN;
    bad[4].place_sd[2] = -0.1;
    bad[5].heading_sd = -0.5;
    bad[6].max_iterations = 0;
    bad[7].lag = 65;
    bad[8].max_rate = 0;
    bad[9].camera.fx = 0;
    bad[10].turn_sd = 0;
    bad[11].fit_threshold = -1;
    bad[12].place[0] = INFINITY;
    bad[13].projection = GAIT_LIFT_ORTHOGRAPHIC;
    bad[13].axis[0][1] = 0.1;
    bad[14].cpu_mask = 16;
    bad[15].camera.t[1] = -5e4f;
    bad[16].camera.t[0] = 5e4f;
    bad[17].camera.t[2] = 5e4f;
    bad[18].stature_sd = -0.5;
    bad[19].residual = -0.5;
    for (int i = 0; i < 2; i++) {
        bad[20 + i].projection = GAIT_LIFT_ORTHOGRAPHIC;
        bad[20 + i].axis[i][0] = 2.0;
    }
    bad[22].camera.cx = 3e38f;
    bad[23].camera.fx = 1e-30f;
    for (int i = 0; i < BAD; i++) {
        err.text[0] = '\0';
        bool const whole = i == 6 || i == 7; /* max_iterations, lag */
        CHECK(gait_lift_bytes(toy_lift_model, &bad[i], &bytes, &err) ==
              (whole ? GAIT_ERR_LIMIT : GAIT_ERR_ARG));
        CHECK(strstr(err.text, "lift config") != NULL);
        CHECK(gait_lift_init(toy_lift_memory, bytes, toy_lift_model, &bad[i], &l, NULL) != GAIT_OK);
    }
    bad[0].struct_size = 0;
    CHECK(gait_lift_bytes(toy_lift_model, &bad[0], &bytes, &err) == GAIT_ERR_STRUCT);
    l = toy_lift_open(&good);
    CHECK(strcmp(gait_lift_marker_name(l, 3), "l_shoulder") == 0 && !gait_lift_marker_name(l, TOY_MARKERS));
    CHECK(!gait_lift_marker_name(l, -1));
    CHECK(gait_lift_positions(l, mean, sd, NULL) == GAIT_ERR_STATE);
    CHECK(gait_lift_posterior(l, mean, NULL, NULL) == GAIT_ERR_STATE);
    CHECK(gait_lift_least_squares(l, mean, NULL) == GAIT_ERR_STATE);
    CHECK(gait_lift_fix(l, sds, NULL) == GAIT_ERR_STATE); /* a perspective view */
    CHECK(gait_lift_batch(l, -1, uv, mean, NULL) == GAIT_ERR_ARG);
    CHECK(gait_lift_uncertain(l, 0, mean, sd, NULL) == GAIT_ERR_ARG);
    CHECK(gait_lift_push(l, -1, uv, NULL, NULL) == GAIT_ERR_STATE);
    CHECK(gait_lift_weight_outliers(0, mean, sd, uv) == 0);
}

/* A prior with rotated copies is in the axes of the world: its heading is not searched for. */
static void test_world_axes(void)
{
    toy_lift_learn(1, 8);
    gait_lift_config const c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    gait_lift_config about = c;
    about.heading_sd = 0.2; /* it is still known about as well */
    CHECK(gait_lift_unknowns(toy_lift_open(&about)) == TOY_MODES + 4);
    gait_lift *const l = toy_lift_open(&c);
    CHECK(gait_lift_unknowns(l) == TOY_MODES + 3);
    toy_lift_learn(1, 0);
    CHECK(gait_lift_unknowns(toy_lift_open(&c)) == TOY_MODES + 4);
}

int main(void)
{
    toy_lift_learn(1, 0);
    test_exact();
    test_coverage(GAIT_LIFT_PERSPECTIVE, 2.0);
    test_coverage(GAIT_LIFT_ORTHOGRAPHIC, 0.02);
    test_missing();
    test_report();
    test_mixture();
    test_batch(0.0);
    test_batch(0.05);
    test_uncertain();
    test_scale();
    test_robust();
    test_expected_and_unknown();
    test_least_squares(-1.0);
    test_least_squares(0.2);
    test_least_squares(0.0);
    test_stature();
    test_absurd();
    test_out_of_range(GAIT_LIFT_PERSPECTIVE, -1.0);
    test_out_of_range(GAIT_LIFT_PERSPECTIVE, 0.2);
    test_out_of_range(GAIT_LIFT_ORTHOGRAPHIC, -1.0);
    test_out_of_range(GAIT_LIFT_ORTHOGRAPHIC, 0.0);
    test_nothing();
    test_an_older_config();
    test_arguments();
    test_world_axes();
    return CHECK_DONE();
}
