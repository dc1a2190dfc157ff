/* toy_passer.h - 2-D points of a person who passes the camera again and again, with gaps, and calls of every function of
 * a lifter. */
#ifndef TOY_PASSER_H
#define TOY_PASSER_H
#include "toy_lift.h"

enum {
    PASSER_RATE = 30,
    PASSER_WAY = 120,
    PASSER_GONE = 20
}; /* frames per second; per pass; at the end of a pass without the person */

/* Push frame `i`: a rigid body moves along x; each pass starts where the first one did, a jump that does not fit. */
static inline gait_result passer_push(gait_lift *l, const gait_lift_config *c, int i)
{
    double X[TOY_MARKERS][3], uv[TOY_MARKERS * 2], sd[TOY_MARKERS];
    double const seconds = (double)(i % PASSER_WAY) / PASSER_RATE, step = 0.03 * (double)TOY_FPS * seconds;
    uint32_t seed = 5u + (uint32_t)i;
    for (int j = 0; j < TOY_MARKERS; j++)
        for (int a = 0; a < 3; a++)
            X[j][a] =
                (double)TOY_STATURE * ((double)toy_lift_prior.mean[0][j][a] + (a == 0 ? step - 1.2 : 0.0));
    toy_lift_see(c, (const double (*)[3])X, TOY_MARKERS, 1.0, seed, uv);
    for (int j = 0; j < TOY_MARKERS; j++)
        sd[j] = i % PASSER_WAY >= PASSER_WAY - PASSER_GONE || toy_random(&seed) > 0.7 ? INFINITY : 1.0;
    return gait_lift_push(l, (int64_t)i * 1000000 / PASSER_RATE, uv, sd, NULL);
}

/* Call all functions of a segment, which is drawn from the prior. */
static inline bool passer_segment(gait_lift *l, const gait_lift_config *c)
{
    static double X[TOY_SEGMENT][3], uv[2 * TOY_SEGMENT], mean[3 * TOY_SEGMENT], sd[3 * TOY_SEGMENT];
    static double unknown[GAIT_MAX_MODES], covariance[GAIT_MAX_MODES * GAIT_MAX_MODES];
    const double place[3] = {0.2, 0.3, 0.01};
    gait_lift_fit fit;
    double largest = 0.0;
    toy_draw(&toy_lift_prior, 0, 3, 0.4, place, X);
    toy_lift_see(c, (const double (*)[3])X, TOY_SEGMENT, 1.0, 7, uv);
    bool ok = gait_lift_segment(l, uv, NULL, &fit, NULL) == GAIT_OK;
    ok &= gait_lift_positions(l, mean, sd, NULL) == GAIT_OK;
    ok &= gait_lift_posterior(l, unknown, covariance, NULL) == GAIT_OK;
    ok &= gait_lift_uncertain(l, 1, mean, &largest, NULL) == GAIT_OK && largest > 0.0;
    return ok && gait_lift_least_squares(l, mean, NULL) == GAIT_OK;
}

/* A stream of `frames` with an estimate after each.  False if a call failed, or if the stream did not have estimates both
 * in frames that fit and in frames that do not, as after a jump. */
static inline bool passer_stream(gait_lift *l, const gait_lift_config *c, int frames)
{
    int followed = 0, fits = 0;
    bool ok = true;
    for (int i = 0; i < frames; i++) {
        gait_lift_frame f;
        ok &= passer_push(l, c, i) == GAIT_OK;
        if (gait_lift_estimate(l, &f, NULL) == GAIT_OK && f.status != GAIT_TRACK_INIT) {
            followed++;
            fits += f.status == GAIT_TRACK_TRACKING;
        }
    }
    return ok && followed > frames / 3 && fits > 0 && fits < followed;
}
#endif
