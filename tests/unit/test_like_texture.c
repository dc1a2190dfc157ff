/* Brightness constancy of one limb against values worked out by hand, and the bounds of the occlusion mixture. */
#include "toy_body.h"

#include "check.h"

enum { LANE = 5 };

static toy_body *v;
static like_patch now[TOY_LIMBS], then[TOY_LIMBS];

/* Of the samples as they are. */
static float log_likelihood(void)
{
    like_body const b = {.setup = &v->setup,
                         .features = &v->f,
                         .outline = &v->outline,
                         .lane = LANE,
                         .samples = now,
                         .terms = &v->terms,
                         .ancestor = then};
    return like_texture.log_likelihood(&b);
}

/* One limb with this cosine to the image plane; n samples seen in both frames, differing by d; the rest in one. */
static float limb(int32_t mode, double cos_tilt, int n, int d)
{
    v = toy_body_new(0, mode);
    v->setup.limbs = 1;
    v->outline.limb[0].cos_tilt[LANE] = (float)cos_tilt;
    now[0].turn = then[0].turn = 0;
    for (int i = 0; i < LIKE_HALF; i++) {
        now[0].value[i] = (int8_t)(i < n ? 20 : i % 2 ? TEXTURE_HIDDEN : 3);
        then[0].value[i] = (int8_t)(i < n ? 20 - d : i % 2 ? 100 : TEXTURE_HIDDEN);
    }
    return log_likelihood();
}

static double cost(int d)
{
    return 2.5 * log(1.0 + d / 16.0 * (d / 16.0) / 4.0);
}

static double mixture(double q, double visible, double occluded)
{
    return log(q * exp(visible) + (1.0 - q) * exp(occluded));
}

/* Default form: mean Student-t cost; "occluded" costs 1.6; share of 12.8 samples seen in both frames. */
static void test_robust(void)
{
    static const double cos_tilt[] = {1.0, 0.9, 0.5, 0.0};
    static const int diff[] = {0, 5, 16, 40, 100};
    for (size_t k = 0; k < sizeof cos_tilt / sizeof *cos_tilt; k++)
        for (size_t i = 0; i < sizeof diff / sizeof *diff; i++) {
            CHECK_NEAR(limb(GAIT_MODE_DEFAULT, cos_tilt[k], 16, diff[i]),
                       mixture(cos_tilt[k], -cost(diff[i]), -1.6), 0.01);
            CHECK_NEAR(limb(GAIT_MODE_DEFAULT, cos_tilt[k], 8, diff[i]),
                       mixture(cos_tilt[k] * 8.0 / 12.8, -cost(diff[i]), -1.6), 0.01);
            CHECK(limb(GAIT_MODE_DEFAULT, cos_tilt[k], 7, diff[i]) == -1.6f); /* too few points: occluded */
        }
    /* Bounded on both sides: neither a match nor a mismatch of one limb decides alone. */
    CHECK_NEAR(limb(GAIT_MODE_DEFAULT, 1.0, 16, 0), 0.0, 1e-5);
    for (int d = 0; d < 140; d += 10) {
        float const ll = limb(GAIT_MODE_DEFAULT, 0.95, 16, d);
        CHECK(ll <= 0.0f && ll > -1.6f + (float)log(0.05) - 0.01f);
    }
}

/* Equations 10-13: mean squared grey-level difference, variance 2 x 9 + 64 (1 + tan^2), tan capped at 3; a limb that
 * is not seen has the density 0.0018. */
static void test_paper(void)
{
    static const double cos_tilt[] = {1.0, 0.8, 0.6, 0.2};
    static const int diff[] = {0, 3, 10, 30};
    for (size_t k = 0; k < sizeof cos_tilt / sizeof *cos_tilt; k++) {
        double const f2 = cos_tilt[k] * cos_tilt[k], tan2 = fmin((1.0 - f2) / f2, 9.0);
        double const var = 2.0 * 9.0 + 64.0 * (1.0 + tan2);
        for (size_t i = 0; i < sizeof diff / sizeof *diff; i++) {
            double const log_p = -0.5 * log(2.0 * 3.14159265358979 * var) - diff[i] * diff[i] / (2.0 * var);
            CHECK_NEAR(limb(GAIT_MODE_PAPER, cos_tilt[k], 16, diff[i]),
                       mixture(cos_tilt[k], log_p, log(0.0018)), 0.01);
            CHECK_NEAR(limb(GAIT_MODE_PAPER, cos_tilt[k], 10, diff[i]),
                       mixture(cos_tilt[k] * 10.0 / 12.8, log_p, log(0.0018)), 0.01);
        }
    }
    CHECK_NEAR(limb(GAIT_MODE_PAPER, 1.0, 5, 0), log(0.0018), 0.01);
    /* A fronto-parallel limb falls by about 3 nats at most, then occlusion explains it. */
    CHECK(limb(GAIT_MODE_PAPER, 0.99, 16, 120) > (float)log(0.0018 * 0.01) - 0.01f);
}

/* Each setting of eqs. 10-12 has the effect that the equation states. */
static void test_paper_settings(void)
{
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, GAIT_MODE_PAPER);
    cfg.occluded_density = 1e-4f;
    cfg.surface_sd = 12.0f;
    cfg.surface_tilt = 0.5f;
    cfg.limb_points = 8;
    (void)limb(GAIT_MODE_PAPER, 0.8, 16, 10);
    like_setup_init(&v->setup, toy_model(), &cfg, v->setup.run);
    v->setup.limbs = 1;
    double const var = 2.0 * 9.0 + 144.0 * (1.0 + 0.5 * 0.36 / 0.64);
    double const log_p = -0.5 * log(2.0 * 3.14159265358979 * var) - 100.0 / (2.0 * var);
    CHECK_NEAR(log_likelihood(), mixture(0.8, log_p, log(1e-4)), 0.01);
    for (int i = 0; i < LIKE_HALF; i++)
        if (i >= 5)
            now[0].value[i] = TEXTURE_HIDDEN;
    CHECK_NEAR(log_likelihood(), mixture(0.8 * 5.0 / 6.4, log_p, log(1e-4)), 0.01);
    now[0].value[3] = now[0].value[4] = TEXTURE_HIDDEN; /* three of eight are too few */
    CHECK_NEAR(log_likelihood(), log(1e-4), 0.01);
}

/* n_s points of every half of a limb are compared, on all sides and at all heights. */
static void test_points(void)
{
    for (int n = 2; n <= LIKE_HALF; n += n < 4 ? 2 : 4) {
        gait_tracker_config cfg;
        gait_tracker_default(&cfg, GAIT_MODE_PAPER);
        cfg.limb_points = n;
        v = toy_body_new(0, GAIT_MODE_PAPER);
        like_setup_init(&v->setup, toy_model(), &cfg, v->setup.run);
        const like_surface *const s = &v->setup.surface[0];
        for (int from = 0; from < LIKE_SAMPLES; from += 2) {
            int count = 0, rows = 0, sides = 0;
            for (int i = from; i < from + LIKE_HALF; i++)
                if (s->outward[i] < INFINITY) {
                    count++;
                    rows |= 1 << ((i / 2 % 2) + 2 * (i % 2));
                    sides |= i - from < LIKE_HALF / 2 ? 1 : 2;
                }
            CHECK(count == n && sides == 3 && (n < 8 || rows == 15));
        }
    }
}

/* A limb that has turned since: points of the same number are compared, those that came into view are not. */
static void test_turned(void)
{
    for (int from = 0; from < LIKE_DIRECTIONS; from++)
        for (int by = -8; by < 8; by++) {
            int const both = LIKE_HALF - 2 * abs(by);
            CHECK_NEAR(limb(GAIT_MODE_DEFAULT, 1.0, 16, 0), 0.0, 1e-5);
            then[0].turn = (uint8_t)from;
            now[0].turn = (uint8_t)((from + by) & (LIKE_DIRECTIONS - 1));
            for (int i = 0; i < LIKE_HALF; i++) { /* a point's value is its number */
                then[0].value[i] = (int8_t)(4 * ((2 * from + i) % LIKE_SAMPLES));
                now[0].value[i] = (int8_t)(4 * ((2 * now[0].turn + i) % LIKE_SAMPLES));
            }
            like_body const b = {.setup = &v->setup,
                                 .features = &v->f,
                                 .outline = &v->outline,
                                 .lane = LANE,
                                 .samples = now,
                                 .terms = &v->terms,
                                 .ancestor = then};
            double const share = fmin(both / 12.8, 1.0);
            CHECK_NEAR(like_texture.log_likelihood(&b), both < 8 ? -1.6 : mixture(share, 0.0, -1.6), 1e-4);
        }
}

/* Limbs add up; without an ancestor the term is 0. */
static void test_limbs(void)
{
    float const one = limb(GAIT_MODE_DEFAULT, 0.9, 16, 7);
    v->setup.limbs = 3;
    for (int l = 1; l < 3; l++) {
        v->outline.limb[l].cos_tilt[LANE] = 0.9f;
        memset(now[l].value, l == 1 ? 20 : TEXTURE_HIDDEN, LIKE_HALF);
        memset(then[l].value, 13, LIKE_HALF);
    }
    like_body b = {.setup = &v->setup,
                   .features = &v->f,
                   .outline = &v->outline,
                   .lane = LANE,
                   .samples = now,
                   .terms = &v->terms,
                   .ancestor = then};
    CHECK_NEAR(like_texture.log_likelihood(&b), 2.0f * one - 1.6f, 1e-4);
    b.ancestor = NULL;
    CHECK(like_texture.log_likelihood(&b) == 0.0f);
    CHECK(like_texture.flag == GAIT_TERM_TEXTURE &&
          !like_texture.support); /* a wall predicts itself too well */
}

int main(void)
{
    test_robust();
    test_paper();
    test_paper_settings();
    test_points();
    test_turned();
    test_limbs();
    return CHECK_DONE();
}
