/* Curves and forward kinematics against a plain double-precision version, and against the meaning of the angles. */
#include "model/kinematics.h"
#include "api/kernels.h"

#include "base/rng.h"
#include "toy_model.h"
#include "toy_shifted.h"
#include "toy_twin.h"

#include "check.h"

static gait_state random_state(uint32_t i)
{
    float u[4], x[4], y[4];
    rng_uniform4(9, 0, 0, i, 0, u);
    rng_normal4(9, 1, 0, i, 0, x);
    rng_normal4(9, 2, 0, i, 0, y);
    return (gait_state){.phase = u[0],
                        .stride_hz = 0.6f + 0.6f * u[3], /* four standard deviations either way */
                        .stature = 1.5f + 0.5f * u[1],
                        .heading = 6.28f * (u[2] - 0.5f),
                        .pitch = 0.1f * x[0],
                        .roll = 0.1f * x[1],
                        .pelvis = {3.0f * x[2], 3.0f * x[3], 1.0f + 0.1f * y[0]},
                        .coef = {y[1], y[2]},
                        .proportion = {y[3]}};
}

static void put_lane(const gait_model *m, kin_input *in, int lane, const gait_state *s)
{
    in->phase[lane] = s->phase;
    in->pace[lane] = kin_pace(m, s->stride_hz);
    in->stature[lane] = s->stature;
    in->heading[lane] = s->heading;
    in->pitch[lane] = s->pitch;
    in->roll[lane] = s->roll;
    for (int k = 0; k < 3; k++)
        in->pelvis[k][lane] = s->pelvis[k];
    for (int k = 0; k < GAIT_MAX_COMPONENTS; k++)
        in->coef[k][lane] = s->coef[k];
    for (int k = 0; k < GAIT_MAX_PROPORTIONS; k++)
        in->proportion[k][lane] = s->proportion[k];
}

/* Everything of a block, from states first .. first + BLOCK - 1. */
typedef struct block {
    kin_channels ch;
    kin_body body;
    float xyz[GAIT_MAX_JOINTS][3][BLOCK];
} block;

static void run_block(const gait_model *m, uint32_t first, block *b)
{
    kin_input filled = {0};
    for (int lane = 0; lane < BLOCK; lane++) {
        gait_state const s = random_state(first + (uint32_t)lane);
        put_lane(m, &filled, lane, &s);
    }
    const kernels *const run = kernels_choose(~0u);
    run->kin_curves(m, &filled, m->components, &b->ch);
    run->kin_pose(m, &b->ch, &filled, m->proportions, &b->body);
    kin_points(m, &b->body, b->xyz);
}

/* ---- tests ---- */
static void test_against_twin(const gait_model *m)
{
    static block b;
    double worst = 0.0, angle = 0.0, turn = 0.0;
    for (uint32_t first = 0; first < 160; first += BLOCK) {
        run_block(m, first, &b);
        for (int lane = 0; lane < BLOCK; lane++) {
            gait_state const s = random_state(first + (uint32_t)lane);
            twin t;
            twin_pose(m, &s, &t);
            for (int i = 0; i < m->channels; i++)
                angle = fmax(angle, fabs(twin_channel(m, i, &s) - (double)b.ch.v[i][lane]));
            for (int f = 0; f < m->frames; f++)
                for (int k = 0; k < 9; k++)
                    turn = fmax(turn, fabs(t.R[f][k / 3][k % 3] - (double)b.body.R[f][k][lane]));
            for (int i = 0; i < m->points; i++) {
                double p[3];
                twin_point(&t, m->point_frame[i], m->point_offset + 3 * i,
                           twin_scale(m, &s, m->point_frame[i]), p);
                for (int k = 0; k < 3; k++)
                    worst = fmax(worst, fabs(p[k] - (double)b.xyz[i][k][lane]));
            }
            for (int f = 0; f < m->frames; f++)
                CHECK_NEAR(b.body.scale[f][lane], twin_scale(m, &s, f), 1e-6);
        }
    }
    CHECK_NEAR(angle, 0.0, 3e-6); /* phase x T in float */
    CHECK_NEAR(turn, 0.0, 5e-6);
    CHECK_NEAR(worst, 0.0, 5e-6); /* metres, up to 10 m from the origin */
}

/* A single body has the bits of a lane, whatever the other lanes hold. */
static void test_lanes(const gait_model *m)
{
    static block b;
    for (uint32_t first = 0; first < 7; first++) {
        run_block(m, first, &b);
        for (int lane = 0; lane < BLOCK; lane++) {
            gait_state const s = random_state(first + (uint32_t)lane);
            gait_pose pose;
            int same = model_pose_state(m, &s, &pose) == GAIT_OK;
            for (int i = 0; i < m->points; i++)
                for (int k = 0; k < 3; k++)
                    same &= pose.joint[i][k] == b.xyz[i][k][lane];
            for (int i = 0; i < m->angles; i++)
                same &= pose.angle[i] == b.ch.v[i][lane];
            CHECK(same);
            CHECK(pose.joint[m->points][0] == 0.0f && pose.angle[m->angles] == 0.0f);
        }
    }
}

/* Channels of the mean shape at one phase. */
static const float *mean_at(float phase, int32_t components, const float score[2])
{
    static kin_channels ch;
    static float value[TOY_CHANNELS];
    kin_input filled = {0};
    filled.phase[3] = phase;
    filled.coef[0][3] = score[0];
    filled.coef[1][3] = score[1];
    kernels_choose(~0u)->kin_curves(toy_model(), &filled, components, &ch);
    for (int i = 0; i < TOY_CHANNELS; i++)
        value[i] = ch.v[i][3];
    return value;
}

static void test_curves(void)
{
    const gait_model *const m = toy_model();
    const float none[2] = {0, 0}, score[2] = {1.5f, -2.0f};
    float kept[TOY_CHANNELS];
    for (int j = 0; j < TOY_PHASES; j++) { /* at a sample: the sample; between two: their mean */
        const float *const row = m->curves + j * TOY_CHANNELS;
        const float *const next = m->curves + (j + 1) % TOY_PHASES * TOY_CHANNELS;
        float const phase = (float)j / TOY_PHASES;
        CHECK(memcmp(mean_at(phase, 0, none), row, sizeof kept) == 0);
        CHECK(memcmp(mean_at(phase, 2, none), row, sizeof kept) == 0);
        CHECK(memcmp(mean_at(phase, 0, score), row, sizeof kept) == 0); /* unused scores are ignored */
        CHECK(memcmp(mean_at(phase - 3.0f, 0, none), row, sizeof kept) == 0);
        CHECK(memcmp(mean_at(phase + 1.0f, 0, none), row, sizeof kept) == 0);
        const float *const middle = mean_at(phase + 0.5f / TOY_PHASES, 0, none);
        for (int i = 0; i < TOY_CHANNELS; i++)
            CHECK(middle[i] == 0.5f * row[i] + 0.5f * next[i]);
    }
    memcpy(kept, mean_at(0.999999f, 2, score), sizeof kept);
    const float *const first = mean_at(0.0f, 2, score);
    for (int i = 0; i < TOY_CHANNELS; i++)
        CHECK_NEAR(kept[i], first[i], 1e-4);
    mean_at(nanf(""), 2, score); /* a broken particle must not index out of the table */
    CHECK(isfinite(mean_at(3e30f, 2, score)[0]));
}

/* Half a stride later the person is their own mirror image. */
static void test_mirror(void)
{
    const gait_model *const m = toy_model();
    for (uint32_t i = 0; i < 40; i++) {
        gait_state s = random_state(i), t;
        gait_pose a, b;
        t = s;
        t.phase = s.phase + 0.5f;
        t.heading = -s.heading;
        t.roll = -s.roll;
        t.pelvis[1] = -s.pelvis[1];
        CHECK(model_pose_state(m, &s, &a) == GAIT_OK && model_pose_state(m, &t, &b) == GAIT_OK);
        for (int j = 0; j < m->points; j++) {
            int const twin_joint = j < 3 ? j : j % 2 ? j + 1 : j - 1; /* l_, r_ alternate */
            CHECK_NEAR(a.joint[j][0], b.joint[twin_joint][0], 3e-5);
            CHECK_NEAR(a.joint[j][1], -b.joint[twin_joint][1], 3e-5);
            CHECK_NEAR(a.joint[j][2], b.joint[twin_joint][2], 3e-5);
        }
    }
}

/* A model at rest with one channel driven by the first score. */
static const gait_model *driven(int channel)
{
    static _Alignas(GAIT_ALIGN) unsigned char buf[TOY_BYTES];
    static gait_model m;
    size_t const bytes = toy_write(buf, 8, 1);
    CHECK(model_open(buf, bytes, &m, NULL) == GAIT_OK);
    float *const curve = (float *)(buf + ((const unsigned char *)m.curves - buf));
    memset(curve, 0, 2 * 8 * TOY_CHANNELS * sizeof *curve);
    for (int j = 0; j < 8 && channel >= 0; j++)
        curve[(8 + j) * TOY_CHANNELS + channel] = 1.0f;
    toy_seal(buf, bytes);
    CHECK(model_open(buf, bytes, &m, NULL) == GAIT_OK);
    return &m;
}

/* How far a point moves from rest along an axis when the channel is +0.2 rad. */
static float moved(int channel, const char *point, int axis)
{
    const gait_model *const m = driven(channel);
    gait_state s = {.stature = 2.0f};
    gait_pose rest, pose;
    CHECK(model_pose_state(m, &s, &rest) == GAIT_OK);
    s.coef[0] = 0.2f;
    CHECK(model_pose_state(m, &s, &pose) == GAIT_OK);
    int32_t const p = toy_find_point(m, point);
    return pose.joint[p][axis] - rest.joint[p][axis];
}

enum { X, Y, Z };

/* x forward, y left, z up; lengths times sin or 1 - cos of 0.2 rad at a stature of 2 m. */
static void test_signs(void)
{
    float const s = 2.0f * sinf(0.2f);
    CHECK_NEAR(moved(TOY_HIP, "l_knee", X), TOY_THIGH * s, 1e-5); /* flexion lifts forward, both sides */
    CHECK_NEAR(moved(TOY_HIP + TOY_PAIR, "r_knee", X), TOY_THIGH * s, 1e-5);
    CHECK_NEAR(moved(TOY_HIP + TOY_PAIR, "l_knee", X), 0.0, 0.0);
    CHECK_NEAR(moved(TOY_HIP + 1, "l_knee", Y), TOY_THIGH * s, 1e-5); /* abduction: away from the body */
    CHECK_NEAR(moved(TOY_HIP + TOY_PAIR + 1, "r_knee", Y), -TOY_THIGH * s, 1e-5);
    CHECK_NEAR(moved(TOY_HIP + 2, "l_toe", Y), -0.069f * s, 1e-5); /* rotation: inwards */
    CHECK_NEAR(moved(TOY_HIP + TOY_PAIR + 2, "r_toe", Y), 0.069f * s, 1e-5);
    CHECK_NEAR(moved(TOY_KNEE, "l_ankle", X), -TOY_SHANK * s, 1e-5); /* flexion: the shank goes back */
    CHECK_NEAR(moved(TOY_KNEE + 1, "r_ankle", X), -TOY_SHANK * s, 1e-5);
    CHECK(moved(TOY_ANKLE, "l_toe", Z) > 0.02f && moved(TOY_ANKLE + 1, "r_toe", Z) > 0.02f); /* toes up */
    CHECK_NEAR(moved(TOY_SHOULDER, "l_elbow", X), TOY_UPPER_ARM * s, 1e-5);
    CHECK_NEAR(moved(TOY_SHOULDER + TOY_PAIR, "r_elbow", X), TOY_UPPER_ARM * s, 1e-5);
    CHECK_NEAR(moved(TOY_SHOULDER + 1, "l_elbow", Y), TOY_UPPER_ARM * s, 1e-5);
    CHECK_NEAR(moved(TOY_SHOULDER + TOY_PAIR + 1, "r_elbow", Y), -TOY_UPPER_ARM * s, 1e-5);
    CHECK_NEAR(moved(TOY_ELBOW, "l_wrist", X), TOY_FOREARM * s, 1e-5);
    CHECK_NEAR(moved(TOY_ELBOW + 1, "r_wrist", X), TOY_FOREARM * s, 1e-5);
    CHECK_NEAR(moved(TOY_TORSO, "neck", Y), -TOY_NECK_Z * s, 1e-5); /* + about x: to the right */
    CHECK_NEAR(moved(TOY_TORSO + 1, "neck", X), TOY_NECK_Z * s, 1e-5);
    CHECK_NEAR(moved(TOY_TORSO + 2, "l_shoulder", X), -0.107f * s, 1e-5);
    CHECK_NEAR(moved(TOY_NECK, "head_top", Y), -TOY_HEAD * s, 1e-5);
    CHECK_NEAR(moved(TOY_NECK + 1, "head_top", X), TOY_HEAD * s, 1e-5);
    CHECK_NEAR(moved(TOY_ROOT + ROOT_YAW, "l_hip", X), -TOY_HIP_HALF * s, 1e-5);
    CHECK_NEAR(moved(TOY_ROOT + ROOT_PITCH, "neck", X), TOY_NECK_Z * s, 1e-5);
    CHECK_NEAR(moved(TOY_ROOT + ROOT_ROLL, "l_hip", Z), TOY_HIP_HALF * s, 1e-5);
    for (int c = ROOT_FORWARD; c <= ROOT_HEIGHT; c++) /* they move the dynamics, not the pose */
        CHECK(moved(TOY_ROOT + c, "head_top", X) == 0.0f && moved(TOY_ROOT + c, "pelvis", Z) == 0.0f);
}

/* Rotation of a hanging arm moves no joint: look at the frame. */
static void test_shoulder_rotation(void)
{
    for (int side = 0; side < 2; side++) {
        const gait_model *const m = driven(TOY_SHOULDER + side * TOY_PAIR + 2);
        kin_input filled = {0};
        filled.coef[0][0] = 0.2f;
        filled.stature[0] = 1.7f;
        static kin_channels ch;
        static kin_body body;
        kernels_choose(~0u)->kin_curves(m, &filled, 1, &ch);
        kernels_choose(~0u)->kin_pose(m, &ch, &filled, m->proportions, &body);
        CHECK_NEAR(body.R[3 + 5 * side][3][0], side ? sin(0.2) : -sin(0.2), 1e-6); /* y of its x axis */
    }
}

/* Heading rotates the body about z, pitch leans it forward, roll lifts its left side. */
static void test_placement(void)
{
    const gait_model *const m = driven(-1);
    gait_state s = {.stature = 2.0f, .heading = 0.5f * PI_F, .pelvis = {4, 5, 1}};
    gait_pose p;
    CHECK(model_pose_state(m, &s, &p) == GAIT_OK);
    int32_t const toe = toy_find_point(m, "l_toe"), neck = toy_find_point(m, "neck");
    int32_t const hip = toy_find_point(m, "l_hip");
    CHECK_NEAR(p.joint[toe][X], 4.0 - 2 * TOY_HIP_HALF, 1e-5); /* left of +y is -x */
    CHECK_NEAR(p.joint[toe][Y], 5.0 + 2 * 0.069, 1e-5);
    CHECK_NEAR(p.joint[toe][Z], 1.0 - 2 * (TOY_THIGH + TOY_SHANK + 0.0235), 1e-5);
    s.heading = 0.0f;
    s.pitch = 0.2f;
    CHECK(model_pose_state(m, &s, &p) == GAIT_OK);
    CHECK_NEAR(p.joint[neck][X], 4.0 + 2 * TOY_NECK_Z * sin(0.2), 1e-5);
    s.pitch = 0.0f;
    s.roll = 0.2f;
    CHECK(model_pose_state(m, &s, &p) == GAIT_OK);
    CHECK_NEAR(p.joint[hip][Z], 1.0 + 2 * TOY_HIP_HALF * sin(0.2), 1e-5);
    CHECK(p.joint[0][X] == 4.0f && p.joint[0][Y] == 5.0f && p.joint[0][Z] == 1.0f);
}

static void test_pelvis_height(void)
{
    const gait_model *const m = toy_model();
    for (uint32_t i = 0; i < 20; i++) {
        gait_state const s = random_state(i);
        float height = 0.0f;
        CHECK(model_pelvis_height(m, &s, &height) == GAIT_OK);
        CHECK_NEAR(height, twin_scale(m, &s, m->frames) * twin_channel(m, TOY_ROOT + ROOT_HEIGHT, &s), 1e-5);
    }
}

/* The toy person stands on the ground: feet never below it, one always near it. */
static void test_ground(void)
{
    const gait_model *const m = toy_model();
    for (int j = 0; j < 64; j++) {
        gait_state const s = toy_state((float)j / 64.0f);
        gait_pose p;
        float lowest = 1.0f;
        CHECK(model_pose_state(m, &s, &p) == GAIT_OK);
        for (int i = 15; i < 19; i++)
            lowest = f_min(lowest, p.joint[i][2]);
        CHECK(lowest > 0.02f && lowest < 0.065f); /* heel and toe joints lie inside the foot */
    }
}

/* A state without a rate, and one at the mean rate, have the mean cycle; beyond two standard deviations nothing changes. */
static void test_pace(void)
{
    const gait_model *const plain = toy_model(), *const m = toy_shifted();
    CHECK(kin_pace(plain, 2.0f) == 0.0f && kin_pace(m, 0.0f) == 0.0f && kin_pace(m, m->stride_hz) == 0.0f);
    CHECK(kin_pace(m, 2.4f) == 2.0f && kin_pace(m, 0.5f) == -2.0f);
    CHECK_NEAR(kin_pace(m, m->stride_hz + 0.5f * m->stride_hz_sd), 0.5, 1e-5);
    gait_state s = random_state(3);
    gait_pose without, mean, fast;
    s.stride_hz = 0.0f;
    CHECK(model_pose_state(m, &s, &without) == GAIT_OK);
    s.stride_hz = m->stride_hz;
    CHECK(model_pose_state(m, &s, &mean) == GAIT_OK);
    s.stride_hz = 2.4f;
    CHECK(model_pose_state(m, &s, &fast) == GAIT_OK);
    CHECK(memcmp(&without, &mean, sizeof mean) == 0 && memcmp(&fast, &mean, sizeof mean) != 0);
}

int main(void)
{
    test_against_twin(toy_model());
    test_against_twin(toy_shifted());
    test_lanes(toy_model());
    test_lanes(toy_shifted());
    test_curves();
    test_pace();
    test_mirror();
    test_signs();
    test_shoulder_rotation();
    test_placement();
    test_pelvis_height();
    test_ground();
    return CHECK_DONE();
}
