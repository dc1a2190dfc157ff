/* The mirror of left and right: the mirrored body half a stride later, at the same place. */
#include "api/kernels.h"
#include "filter/mirror.h"

#include "base/rng.h"
#include "toy_tracker.h"

#include "check.h"

static state_layout rule(uint32_t offsets)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.offset_angles = offsets;
    return state_layout_init(toy_model(), &cfg, kernels_choose(~0u));
}

static particle_state some(const state_layout *r, uint32_t index)
{
    float n[16];
    particle_state w = {{0}};
    for (uint32_t k = 0; k < 16; k += 4)
        rng_normal4(5, 0, 0, index, k, n + k);
    w.f[F_PHASE] = 0.03f + 0.07f * (float)index;
    w.f[F_RATE] = 0.9f;
    w.f[F_STATURE] = 1.75f;
    w.f[F_X] = n[0];
    w.f[F_Y] = n[1];
    w.f[F_Z] = 0.01f * n[2];
    w.f[F_PITCH] = 0.05f * n[3];
    w.f[F_ROLL] = 0.05f * n[4];
    for (int32_t k = 0; k < r->components; k++)
        w.f[F_COEF + k] = n[5 + k];
    for (int32_t k = 0; k < r->offsets; k++)
        w.f[state_layout_offset(r) + k] = 0.05f * n[8 + k];
    return w;
}

/* The joint on the other side. */
static int32_t twin(int32_t point)
{
    char name[32];
    snprintf(name, sizeof name, "%s", gait_model_joint_name(toy_model(), point));
    if (name[1] != '_')
        return point;
    name[0] = name[0] == 'l' ? 'r' : 'l';
    for (int32_t p = 0; p < TOY_POINTS; p++)
        if (strcmp(gait_model_joint_name(toy_model(), p), name) == 0)
            return p;
    return -1;
}

/* Heading along x: mirrored in the track's vertical plane every joint lies on its twin. */
static void test_the_image_is_the_mirrored_body(void)
{
    state_layout const r = rule(TOY_TRUNK);
    mirror x;
    mirror_init(&x, &r);
    for (uint32_t i = 0; i < 12; i++) {
        particle_state const w = some(&r, i), other = mirror_apply(&x, &r, &w);
        gait_state const a = particle_to_state(&r, &w), b = particle_to_state(&r, &other);
        gait_pose here, there;
        double worst = 0.0;
        CHECK(gait_model_pose(toy_model(), &a, &here, NULL) == GAIT_OK);
        CHECK(gait_model_pose(toy_model(), &b, &there, NULL) == GAIT_OK);
        for (int32_t p = 0; p < TOY_POINTS; p++) {
            const float *const one = here.joint[p], *const two = there.joint[twin(p)];
            worst = fmax(worst, fabs((double)(one[0] - two[0])));
            worst = fmax(worst, fabs((double)((one[1] - w.f[F_Y]) + (two[1] - w.f[F_Y]))));
            worst = fmax(worst, fabs((double)(one[2] - two[2])));
        }
        CHECK_NEAR(worst, 0.0, 2e-3);
    }
}

/* Mirroring twice changes nothing; place, rate, heading and stature never change. */
static void test_twice_is_nothing(void)
{
    state_layout const r = rule(TOY_TRUNK);
    mirror x;
    mirror_init(&x, &r);
    for (uint32_t i = 0; i < 12; i++) {
        particle_state const w = some(&r, i), once = mirror_apply(&x, &r, &w),
                             twice = mirror_apply(&x, &r, &once);
        for (int32_t f = 0; f < state_layout_fields(&r); f++)
            CHECK_NEAR(twice.f[f], w.f[f], 1e-3);
        static const int32_t SAME[] = {F_RATE, F_X, F_Y, F_Z, F_HEADING, F_PITCH, F_STATURE, F_TURN};
        for (size_t k = 0; k < sizeof SAME / sizeof *SAME; k++)
            CHECK(once.f[SAME[k]] == w.f[SAME[k]]);
        CHECK_NEAR(once.f[F_PHASE], w.f[F_PHASE] + (w.f[F_PHASE] < 0.5f ? 0.5f : -0.5f), 1e-6);
    }
}

/* Only l_ and r_ are sides, and the rest of the name is the same. */
static void test_other_side(void)
{
    static const char name[][MODEL_NAME] = {"l_knee", "head", "r_knee_flexion", "r_knee",
                                            "lead",   "read", "l_toe"};
    static const int32_t other[] = {3, 1, 2, 0, 4, 5, 6};
    for (int32_t i = 0; i < 7; i++)
        CHECK(model_other_side(name, 7, i) == other[i]);
}

int main(void)
{
    test_other_side();
    test_the_image_is_the_mirrored_body();
    test_twice_is_nothing();
    return CHECK_DONE();
}
