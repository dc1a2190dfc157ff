/* toy_error.h - errors of an estimate in the toy scene, and conditions that any estimate must satisfy. */
#ifndef TOY_ERROR_H
#define TOY_ERROR_H
#include "toy_film.h"

#include "check.h"

typedef struct error {
    double across, depth, phase, joint; /* metres; strides for the phase; the largest of all frames added */
    int status[4];
} error;

static inline void measure_error(const gait_estimate *e, int n, error *out)
{
    gait_state const truth = toy_walk((float)n / 30.0f);
    gait_pose pose;
    double joint = 0.0, dp = fabs((double)(e->mean.phase - truth.phase));
    CHECK(gait_model_pose(toy_model(), &truth, &pose, NULL) == GAIT_OK);
    for (int p = 0; p < TOY_POINTS; p++)
        joint += hypot((double)(e->pose.joint[p][0] - pose.joint[p][0]),
                       (double)(e->pose.joint[p][2] - pose.joint[p][2])) /
                 TOY_POINTS;
    out->across = fmax(out->across, hypot((double)(e->mean.pelvis[0] - truth.pelvis[0]),
                                          (double)(e->mean.pelvis[2] - truth.pelvis[2])));
    out->depth = fmax(out->depth, fabs((double)(e->mean.pelvis[1] - truth.pelvis[1])));
    out->phase = fmax(out->phase, fmin(dp, 1.0 - dp));
    out->joint = fmax(out->joint, joint);
}

/* Check conditions that every estimate must satisfy. */
static inline void check_sane(const gait_tracker *t, const gait_estimate *e, const gait_tracker_config *cfg,
                              int steps)
{
    static float weight[1024];
    static gait_state s[1024];
    double square = 0.0, sum = 0.0;
    CHECK(gait_tracker_particles(t, s, weight, 1024, NULL) == cfg->particles);
    for (int i = 0; i < cfg->particles; i++) {
        sum += (double)weight[i];
        square += (double)weight[i] * (double)weight[i];
    }
    CHECK_NEAR(sum, 1.0, 1e-4);
    CHECK_NEAR(e->ess * square, 1.0, 1e-3);
    CHECK(e->frame == (uint64_t)steps && isfinite(e->log_evidence));
    CHECK(e->phase_r >= 0.0f && e->phase_r <= 1.0f && e->hypothesis_weight > 0.0f &&
          e->hypothesis_weight <= 1.0001f);
    for (int p = 0; p < TOY_POINTS; p++)
        for (int k = 0; k < 3; k++)
            CHECK(isfinite(e->pose.joint[p][k]) && e->joint_sd[p][k] >= 0.0f && e->joint_sd[p][k] < 2.0f);
}
#endif
