/* toy_model.h - a small but plausible person as a valid blob, for tests that need a model.
 *
 *   size_t bytes;
 *   const void *blob = toy_model_blob(&bytes);  static, aligned, written once: T = 32, q = 2, about 20 kB
 *   const gait_model *m = toy_model();          the same, initialised in static memory
 *   gait_state s = toy_state(0.25f);            phase 0.25, 1.75 m, mean shape, at the origin, along +x
 *   toy_write(buf, 8, 0);                       a blob with 8 phases and no components; returns its size
 *
 * The skeleton is the default one of doc/model-format.md: 13 frames, 19 points, 13 limbs, 24 angles; names
 * and order too.  The mean cycle is exactly symmetric: half a stride later left and right have swapped.
 * Component 1 is stride size (+-12 % of every swing), component 2 posture (torso, elbows).  Curves are
 * multiples of 2^-16, so that their bits do not depend on the libm that computed them. */
#ifndef TOY_MODEL_H
#define TOY_MODEL_H
#include "toy_blob.h"

#include <math.h>
#include <stdio.h>

enum { TOY_FRAMES = 13, TOY_POINTS = 19, TOY_LIMBS = 13, TOY_ANGLES = 24, TOY_CHANNELS = 30 };
enum { TOY_PHASES = 32, TOY_COMPONENTS = 2, TOY_SECTIONS = 16, TOY_PROPORTIONS = 1 };
/* Channels; a left one is followed by its right twin at + TOY_PAIR (ball joints) or + 1 (hinges). */
enum {
    TOY_NECK,         /* x y z */
    TOY_SHOULDER = 3, /* l flexion abduction rotation, then r */
    TOY_ELBOW = 9,
    TOY_HIP = 11,
    TOY_KNEE = 17,
    TOY_TORSO = 19, /* x y z */
    TOY_ANKLE = 22,
    TOY_ROOT = 24, /* forward sway height roll pitch yaw */
    TOY_PAIR = 3
};

/* ---- shape: fractions of stature, left side; the right mirrors it ---- */
#define TOY_HIP_HALF  0.055f
#define TOY_THIGH     0.240f
#define TOY_SHANK     0.250f
#define TOY_SOLE      0.047f
#define TOY_UPPER_ARM 0.168f
#define TOY_FOREARM   0.155f
#define TOY_NECK_Z    0.320f
#define TOY_HEAD      0.143f

static inline void toy_mirror_name(char out[32], const char name[32])
{
    memcpy(out, name, 32);
    out[0] = 'r';
}

/* Frames 0..2 are the trunk, 3..7 the left side, 8..12 the right. */
static const char toy_frame_name[TOY_FRAMES - 5][32] = {"pelvis",    "torso",   "head",    "l_upper_arm",
                                                        "l_forearm", "l_thigh", "l_shank", "l_foot"};
static const int32_t toy_frame_info[TOY_FRAMES - 5][8] = {
    {-1, 3, 3, TOY_ROOT + 5, 2, TOY_ROOT + 4, 1, TOY_ROOT + 3},
    {0, 3, 3, TOY_TORSO + 2, 2, TOY_TORSO + 1, 1, TOY_TORSO},
    {1, 3, 3, TOY_NECK + 2, 2, TOY_NECK + 1, 1, TOY_NECK},
    {1, 3, -2, TOY_SHOULDER, 1, TOY_SHOULDER + 1, -3, TOY_SHOULDER + 2},
    {3, 1, -2, TOY_ELBOW},
    {0, 3, -2, TOY_HIP, 1, TOY_HIP + 1, -3, TOY_HIP + 2},
    {5, 1, 2, TOY_KNEE},
    {6, 1, -2, TOY_ANKLE},
};
static const float toy_frame_origin[TOY_FRAMES - 5][3] = {
    {0, 0, 0},
    {0, 0, 0},
    {0, 0, TOY_NECK_Z},
    {0, 0.107f, 0.283f},
    {0, 0, -TOY_UPPER_ARM},
    {0, TOY_HIP_HALF, 0},
    {0, 0, -TOY_THIGH},
    {0, 0, -TOY_SHANK},
};

/* EVAL15, then toes and heels; right ones follow their left twins. */
static const struct {
    char name[32];
    int32_t frame;
    float at[3];
} toy_point[] = {
    {"pelvis", 0, {0, 0, 0}},
    {"neck", 2, {0, 0, 0}},
    {"head_top", 2, {0, 0, TOY_HEAD}},
    {"l_shoulder", 3, {0, 0, 0}},
    {"l_elbow", 4, {0, 0, 0}},
    {"l_wrist", 4, {0, 0, -TOY_FOREARM}},
    {"l_hip", 5, {0, 0, 0}},
    {"l_knee", 6, {0, 0, 0}},
    {"l_ankle", 7, {0, 0, 0}},
    {"l_toe", 7, {0.069f, 0, -0.0235f}},
    {"l_heel", 7, {-0.035f, 0, -0.034f}},
};

static const struct {
    char name[32];
    int32_t frame, shape;
    float number[10];
} toy_limb[] = {
    {"torso", 1, 0, {0, 0, 0.06f, 0, 0, 0.298f, 0.084f, 0.063f, 0.099f, 0.063f}},
    {"pelvis", 0, 0, {0, 0, -0.045f, 0, 0, 0.075f, 0.093f, 0.069f, 0.084f, 0.063f}},
    {"head", 2, 1, {0.012f, 0, 0.008f, 0.012f, 0, TOY_HEAD, 0.047f, 0.057f, 0.047f, 0.057f}},
    {"l_upper_arm", 3, 0, {0, 0, 0, 0, 0, -TOY_UPPER_ARM, 0.03f, 0.03f, 0.024f, 0.024f}},
    {"l_forearm", 4, 0, {0, 0, 0, 0, 0, -0.23f, 0.024f, 0.024f, 0.016f, 0.02f}},
    {"l_thigh", 5, 0, {0, 0, 0, 0, 0, -TOY_THIGH, 0.051f, 0.051f, 0.037f, 0.037f}},
    {"l_shank", 6, 0, {0, 0, 0, 0, 0, -TOY_SHANK, 0.036f, 0.036f, 0.024f, 0.025f}},
    {"l_foot", 7, 0, {-0.023f, 0, -0.023f, 0.089f, 0, -0.027f, 0.022f, 0.024f, 0.026f, 0.02f}},
};

/* ---- curves ---- */

/* Right side in degrees at phases 0, 0.1 .. 0.9 (about the usual textbook shapes). */
enum { TOY_CURVES = 9 };
static const struct {
    int channel, pair; /* left channel, distance to the right one */
    double at[10];
} toy_curve[TOY_CURVES] = {
    {TOY_HIP, TOY_PAIR, {28, 25, 15, 5, -4, -10, -4, 14, 26, 30}},
    {TOY_HIP + 1, TOY_PAIR, {-2, -6, -6, -4, -3, 0, 5, 6, 3, 0}},
    {TOY_HIP + 2, TOY_PAIR, {-2, 1, 2, 3, 3, 2, -2, -4, -4, -3}},
    {TOY_KNEE, 1, {4, 14, 16, 9, 4, 8, 36, 62, 52, 16}},
    {TOY_ANKLE, 1, {0, -4, 3, 7, 10, 11, -4, -8, 1, 2}},
    {TOY_SHOULDER, TOY_PAIR, {-18, -16, -10, -1, 8, 12, 11, 5, -5, -14}},
    {TOY_SHOULDER + 1, TOY_PAIR, {9, 8, 7, 6, 6, 6, 7, 8, 9, 9}},
    {TOY_SHOULDER + 2, TOY_PAIR, {2, 2, 1, 0, -1, -2, -2, -1, 0, 1}},
    {TOY_ELBOW, 1, {16, 16, 18, 24, 32, 38, 36, 30, 23, 18}},
};

#define TOY_PI 3.14159265358979323846

/* Trigonometric interpolation of ten samples (degrees) at a phase, radians. */
static inline double toy_interpolate(const double at[10], double phase)
{
    double sum = 0.0;
    for (int j = 0; j < 10; j++) {
        double const d = 2.0 * TOY_PI * (phase - j / 10.0);
        sum += at[j] * (1.0 + 2.0 * (cos(d) + cos(2 * d) + cos(3 * d) + cos(4 * d)) + cos(5 * d)) / 10.0;
    }
    return sum * TOY_PI / 180.0;
}

static inline float toy_round(double x)
{
    return (float)(floor(x * 65536.0 + 0.5) / 65536.0);
}

/* Height of the hip over the sole of one leg, in its sagittal plane, statures. */
static inline double toy_leg_height(const float *v, int side)
{
    double const hip = v[TOY_HIP + side * TOY_PAIR], shank = hip - v[TOY_KNEE + side];
    double const foot = shank + v[TOY_ANKLE + side];
    double const ankle = TOY_THIGH * cos(hip) + TOY_SHANK * cos(shank);
    double const heel = 0.045 * sin(foot), toe = -0.09 * sin(foot);
    return ankle + TOY_SOLE * cos(foot) + (heel > toe ? heel : toe);
}

/* Mean channels at a phase. */
static inline void toy_mean(double phase, float v[TOY_CHANNELS])
{
    double const one = 2.0 * TOY_PI * phase, two = 2.0 * one;
    memset(v, 0, TOY_CHANNELS * sizeof *v);
    for (int i = 0; i < TOY_CURVES; i++) {
        v[toy_curve[i].channel] = toy_round(toy_interpolate(toy_curve[i].at, phase + 0.5));
        v[toy_curve[i].channel + toy_curve[i].pair] = toy_round(toy_interpolate(toy_curve[i].at, phase));
    }
    v[TOY_NECK + 1] = toy_round(-0.03 + 0.01 * cos(two));
    v[TOY_NECK + 2] = toy_round(0.03 * cos(one));
    v[TOY_TORSO] = toy_round(0.03 * sin(one));
    v[TOY_TORSO + 1] = toy_round(0.04 + 0.01 * cos(two));
    v[TOY_TORSO + 2] = toy_round(-0.12 * cos(one));
    v[TOY_ROOT] = toy_round(0.80 + 0.03 * cos(two));
    v[TOY_ROOT + 1] = toy_round(-0.012 * sin(one));
    double const l = toy_leg_height(v, 0), r = toy_leg_height(v, 1);
    v[TOY_ROOT + 2] = toy_round(l > r ? l : r);
    v[TOY_ROOT + 3] = toy_round(-0.05 * sin(one));
    v[TOY_ROOT + 4] = toy_round(0.03 + 0.01 * cos(two));
    v[TOY_ROOT + 5] = toy_round(0.08 * cos(one));
}

/* curve[k][j][channel]: the mean, then up to two components. */
static inline void toy_curves(float *curve, int phases, int components)
{
    size_t const row = TOY_CHANNELS, table = (size_t)phases * row;
    double average[TOY_CHANNELS] = {0};
    for (int j = 0; j < phases; j++) {
        toy_mean((double)j / phases, curve + (size_t)j * row);
        for (size_t i = 0; i < row; i++)
            average[i] += (double)curve[(size_t)j * row + i] / phases;
    }
    for (int k = 1; k <= components; k++)
        for (int j = 0; j < phases; j++)
            for (size_t i = 0; i < row; i++) {
                double const swing = (double)curve[(size_t)j * row + i] - average[i];
                double const elbow = i == TOY_ELBOW || i == TOY_ELBOW + 1 ? 0.15 : 0.0;
                double const posture = i == TOY_TORSO + 1 ? 0.04 : elbow;
                double const change = i == TOY_ROOT ? 0.05 : 0.12 * swing;
                curve[(size_t)k * table + (size_t)j * row + i] = toy_round(k == 1 ? change : posture);
            }
}

/* ---- sections ---- */

/* Index of the frame on the right for one on the left; trunk frames stay. */
static inline int32_t toy_mirror_frame(int32_t f)
{
    return f >= 3 ? f + 5 : f;
}

static inline void toy_put_skeleton(toy_file *f)
{
    static char name[TOY_FRAMES][32];
    static int32_t info[TOY_FRAMES][8];
    static float origin[TOY_FRAMES][3];
    memcpy(name, toy_frame_name, sizeof toy_frame_name);
    memcpy(info, toy_frame_info, sizeof toy_frame_info);
    memcpy(origin, toy_frame_origin, sizeof toy_frame_origin);
    for (int i = 3; i < 8; i++) {
        toy_mirror_name(name[i + 5], name[i]);
        memcpy(info[i + 5], info[i], sizeof info[i]);
        memcpy(origin[i + 5], origin[i], sizeof origin[i]);
        origin[i + 5][1] = -origin[i][1];
        info[i + 5][0] = toy_mirror_frame(info[i][0]);
        for (int k = 0; k < info[i][1]; k++) {
            int32_t *const axis = &info[i + 5][2 + 2 * k];
            *axis = abs(*axis) == 2 ? *axis : -*axis;
            axis[1] += info[i][1] == 3 ? TOY_PAIR : 1;
        }
    }
    /* Long legs on a short trunk; the last column is the pelvis's height. */
    static const float proportion[TOY_PROPORTIONS][TOY_FRAMES + 1] = {
        {0.0f, -0.02f, 0.0f, 0.01f, 0.02f, 0.03f, 0.02f, 0.01f, 0.01f, 0.02f, 0.03f, 0.02f, 0.01f, 0.025f}};
    toy_section(f, "PROP", 3, 2, TOY_PROPORTIONS, TOY_FRAMES + 1, 1, proportion);
    toy_section(f, "FRNM", 1, 2, TOY_FRAMES, 32, 1, name);
    toy_section(f, "FRMI", 2, 2, TOY_FRAMES, 8, 1, info);
    toy_section(f, "FRMF", 3, 2, TOY_FRAMES, 3, 1, origin);
}

static inline void toy_put_points(toy_file *f)
{
    static char name[TOY_POINTS][32];
    static int32_t frame[TOY_POINTS];
    static float at[TOY_POINTS][3];
    int n = 0;
    for (size_t i = 0; i < sizeof toy_point / sizeof *toy_point; i++)
        for (int side = 0; side < (toy_point[i].frame >= 3 ? 2 : 1); side++, n++) {
            memcpy(name[n], toy_point[i].name, 32);
            if (side)
                toy_mirror_name(name[n], toy_point[i].name);
            frame[n] = side ? toy_mirror_frame(toy_point[i].frame) : toy_point[i].frame;
            memcpy(at[n], toy_point[i].at, sizeof at[n]);
        }
    toy_section(f, "PTNM", 1, 2, TOY_POINTS, 32, 1, name);
    toy_section(f, "PTNI", 2, 1, TOY_POINTS, 1, 1, frame);
    toy_section(f, "PTNF", 3, 2, TOY_POINTS, 3, 1, at);
}

static inline void toy_put_limbs(toy_file *f)
{
    static char name[TOY_LIMBS][32];
    static int32_t info[TOY_LIMBS][2];
    static float shape[TOY_LIMBS][10];
    for (int i = 0; i < TOY_LIMBS; i++) {
        int const right = i >= 8, from = right ? i - 5 : i;
        memcpy(name[i], toy_limb[from].name, 32);
        if (right)
            toy_mirror_name(name[i], toy_limb[from].name);
        info[i][0] = right ? toy_mirror_frame(toy_limb[from].frame) : toy_limb[from].frame;
        info[i][1] = toy_limb[from].shape;
        memcpy(shape[i], toy_limb[from].number, sizeof shape[i]);
    }
    toy_section(f, "LBNM", 1, 2, TOY_LIMBS, 32, 1, name);
    toy_section(f, "LIMI", 2, 2, TOY_LIMBS, 2, 1, info);
    toy_section(f, "LIMF", 3, 2, TOY_LIMBS, 10, 1, shape);
}

static inline void toy_put_curves(toy_file *f, int phases, int components)
{
    static const char name[TOY_CHANNELS][32] = {"neck_x",
                                                "neck_y",
                                                "neck_z",
                                                "l_shoulder_flexion",
                                                "l_shoulder_abduction",
                                                "l_shoulder_rotation",
                                                "r_shoulder_flexion",
                                                "r_shoulder_abduction",
                                                "r_shoulder_rotation",
                                                "l_elbow_flexion",
                                                "r_elbow_flexion",
                                                "l_hip_flexion",
                                                "l_hip_abduction",
                                                "l_hip_rotation",
                                                "r_hip_flexion",
                                                "r_hip_abduction",
                                                "r_hip_rotation",
                                                "l_knee_flexion",
                                                "r_knee_flexion",
                                                "torso_x",
                                                "torso_y",
                                                "torso_z",
                                                "l_ankle_flexion",
                                                "r_ankle_flexion",
                                                "root_forward",
                                                "root_sway",
                                                "root_height",
                                                "root_roll",
                                                "root_pitch",
                                                "root_yaw"};
    static const float score[TOY_COMPONENTS][3] = {{1.5f, 0.9f, 0.4f}, {0.8f, 0.8f, 0.6f}};
    static const float gait[8] = {0.92f, 0.07f, 0.02f, 0.80f, 0.06f, 120.0f, 1.72f, 0.09f};
    static float curve[(1 + TOY_COMPONENTS) * TOY_PHASES * TOY_CHANNELS], stat[TOY_CHANNELS][4];
    toy_curves(curve, phases, components);
    for (int i = 0; i < TOY_CHANNELS; i++) {
        const float *const v = curve + i;
        float lo = v[0], hi = v[0];
        for (int j = 1; j < phases; j++) {
            lo = fminf(lo, v[j * TOY_CHANNELS]);
            hi = fmaxf(hi, v[j * TOY_CHANNELS]);
        }
        stat[i][0] = i < TOY_ANGLES ? 0.03f : 0.005f;
        stat[i][1] = lo;
        stat[i][2] = hi;
        stat[i][3] = i < TOY_ANGLES ? 0.05f : 0.005f;
    }
    toy_section(f, "CHNM", 1, 2, TOY_CHANNELS, 32, 1, name);
    toy_section(f, "CURV", 3, 3, 1 + (uint32_t)components, (uint32_t)phases, TOY_CHANNELS, curve);
    toy_section(f, "CHST", 3, 2, TOY_CHANNELS, 4, 1, stat);
    toy_section(f, "SCST", 3, 2, (uint32_t)components, 3, 1, score);
    toy_section(f, "GAIT", 3, 1, 8, 1, 1, gait);
}

#define TOY_TRUNK (1u << TOY_TORSO | 1u << (TOY_TORSO + 1)) /* mask of torso_x and torso_y */

/* Write a blob into buf (at least TOY_BYTES, all of which are cleared); phases [8, 32], components [0, 2]. */
static inline size_t toy_write(unsigned char *buf, int phases, int components)
{
    static const char meta[] = "{\"activity\":\"walk\",\"generator\":\"tests/unit/toy_model.h\"}";
    toy_file f = toy_begin(buf, TOY_SECTIONS);
    toy_section(&f, "META", 1, 1, sizeof meta - 1, 1, 1, meta);
    toy_put_curves(&f, phases, components);
    toy_put_skeleton(&f);
    toy_put_points(&f);
    toy_put_limbs(&f);
    return toy_finish(&f);
}

/* The standard blob in static memory, aligned to GAIT_ALIGN. */
static inline const void *toy_model_blob(size_t *bytes)
{
    static _Alignas(GAIT_ALIGN) unsigned char buf[TOY_BYTES];
    static size_t used;
    if (!used)
        used = toy_write(buf, TOY_PHASES, TOY_COMPONENTS);
    *bytes = used;
    return buf;
}

/* The model of the standard blob, in static memory; stops the test if the library rejects it. */
static inline const gait_model *toy_model(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char mem[1024];
    static gait_model *model;
    gait_error err = {0};
    size_t bytes;
    const void *const data = toy_model_blob(&bytes);
    if (!model && gait_model_init(mem, sizeof mem, data, bytes, &model, &err) != GAIT_OK) {
        fprintf(stderr, "toy model refused: %s\n", err.text);
        abort();
    }
    return model;
}

/* Index of a point by its public name; -1 if there is none. */
static inline int32_t toy_find_point(const gait_model *m, const char *name)
{
    const char *own;
    for (int32_t i = 0; (own = gait_model_joint_name(m, i)) != NULL; i++)
        if (strcmp(own, name) == 0)
            return i;
    return -1;
}

/* A state at the origin, with the model's pelvis height: 1.75 m tall, mean shape, heading +x. */
static inline gait_state toy_state(float phase)
{
    gait_state s = {.phase = phase, .stride_hz = 0.92f, .stature = 1.75f};
    if (gait_model_pelvis_height(toy_model(), &s, &s.pelvis[2], NULL) != GAIT_OK)
        abort();
    return s;
}
#endif
