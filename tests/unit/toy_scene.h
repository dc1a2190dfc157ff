/* toy_scene.h - a synthetic person in front of a textured wall, seen by two cameras.
 *
 *   gait_camera cam = toy_camera(0);          0: from the side, 1: obliquely from the front; SCENE_W x SCENE_H
 *   gait_state s = toy_walk(0.5f);            the truth, seconds after the start, walking along +x
 *   toy_wall(0, grey);                        the empty scene
 *   toy_shot(0, n, grey);                     frame n at 30 per second, with sensor noise
 *   gait_frame f = toy_frame(n);              its time; images are the caller's
 *
 * Pictures are computed with integers and + - * / of floats, so that they have the same bits everywhere. */
#ifndef TOY_SCENE_H
#define TOY_SCENE_H
#include "image/camera.h"
#include "base/fmath.h"
#include "model/kinematics.h"
#include "filter/particles.h"
#include "toy_model.h"

enum { SCENE_W = 384, SCENE_H = 288, SCENE_PIXELS = SCENE_W * SCENE_H, SCENE_CAMERAS = 2 };

/* Rotations of 3-4-5 triangles, no trigonometry. */
static inline gait_camera toy_camera(int k)
{
    gait_camera const side = {.width = SCENE_W,
                              .height = SCENE_H,
                              .fx = 420.0f,
                              .fy = 420.0f,
                              .cx = 191.5f,
                              .cy = 150.0f,
                              .R = {1, 0, 0, 0, 0, -1, 0, 1, 0},
                              .t = {0, 1.2f, 5.5f}};
    gait_camera oblique = side;
    const float R[9] = {0.8f, 0.6f, 0, 0, 0, -1, -0.6f, 0.8f, 0}, t[3] = {0, 1.4f, 5.5f};
    memcpy(oblique.R, R, sizeof R);
    memcpy(oblique.t, t, sizeof t);
    return k ? oblique : side;
}

/* Integer hash (Murmur's finaliser). */
static inline uint32_t toy_hash(uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t h = a * 0x9e3779b1u ^ (b + 0x7f4a7c15u) * 0x85ebca6bu ^ (c + 0x165667b1u) * 0xc2b2ae35u;
    h = (h ^ (h >> 16)) * 0x85ebca6bu;
    h = (h ^ (h >> 13)) * 0xc2b2ae35u;
    return h ^ (h >> 16);
}

/* Smooth noise of cells `size` pixels wide, [0, 255]. */
static inline uint32_t toy_cloud(uint32_t seed, uint32_t x, uint32_t y, uint32_t size)
{
    uint32_t const i = x / size, j = y / size, fx = x % size, fy = y % size;
    uint32_t const a = toy_hash(seed, i, j) & 255, b = toy_hash(seed, i + 1, j) & 255;
    uint32_t const c = toy_hash(seed, i, j + 1) & 255, d = toy_hash(seed, i + 1, j + 1) & 255;
    return ((a * (size - fx) + b * fx) * (size - fy) + (c * (size - fx) + d * fx) * fy) / (size * size);
}

static inline void toy_wall(int camera, uint8_t *grey)
{
    for (uint32_t y = 0; y < SCENE_H; y++)
        for (uint32_t x = 0; x < SCENE_W; x++)
            grey[y * SCENE_W + x] = (uint8_t)(70 + toy_cloud((uint32_t)camera, x, y, 24) * 3 / 10 +
                                              toy_cloud((uint32_t)camera + 9, x, y, 5) / 5);
}

/* Walking along +x past both cameras; pelvis by the model's own sway and height. */
static inline gait_state toy_walk(float seconds)
{
    gait_state s = toy_state(m_wrap1(0.1f + 0.92f * seconds));
    s.pelvis[0] = -1.3f + s.stature * 0.80f * s.stride_hz * seconds;
    s.pelvis[1] = s.stature * root_channel(toy_model(), ROOT_SWAY, s.phase, 0.0f, s.coef, 0);
    return s;
}

/* Grey level of a limb at a pixel: a level for each limb, and bands across its axis that move with it. */
static inline uint8_t toy_skin(int32_t limb, const float from[2], const float to[2], float x, float y)
{
    float const dx = to[0] - from[0], dy = to[1] - from[1], len2 = dx * dx + dy * dy + 4.0f;
    float const along = ((x - from[0]) * dx + (y - from[1]) * dy) / len2;
    float const across = (x - from[0]) * dy - (y - from[1]) * dx;
    uint32_t const band = (uint32_t)(64.0f + 7.0f * f_clamp(along, -4.0f, 4.0f));
    uint32_t const level = 25 + toy_hash(77, (uint32_t)limb, 1) % 190;
    return (uint8_t)(level + toy_hash(band, (uint32_t)limb, across > 0.0f) % 40);
}

/* Draw a person of a model over an image; stops the test if the library rejects it. */
static inline void toy_paint_of(const gait_model *m, const gait_camera *cam, const gait_state *s,
                                uint8_t *grey)
{
    static uint8_t ids[SCENE_PIXELS];
    float end[TOY_LIMBS][2][2] = {{{0}}};
    kin_frames at;
    if (model_place_state(m, s, &at) != GAIT_OK || gait_render(m, cam, s, ids, SCENE_W, NULL) != GAIT_OK)
        abort();
    for (int32_t l = 0; l < TOY_LIMBS; l++)
        for (int32_t e = 0; e < 2; e++) {
            const float *const v = m->limb_shape + LIMB_SHAPE * l + 3 * e;
            int32_t const f = m->limb_info[LIMB_INFO * l];
            float p[3];
            for (int32_t k = 0; k < 3; k++)
                p[k] = at.o[3 * f + k] +
                       at.scale[f] * (at.R[9 * f + 3 * k] * v[0] + at.R[9 * f + 3 * k + 1] * v[1] +
                                      at.R[9 * f + 3 * k + 2] * v[2]);
            camera_project(cam, p, end[l][e]);
        }
    for (int32_t i = 0; i < SCENE_PIXELS; i++)
        if (ids[i]) {
            int32_t const l = ids[i] - 1;
            grey[i] = toy_skin(l, end[l][0], end[l][1], (float)(i % SCENE_W), (float)(i / SCENE_W));
        }
}

static inline void toy_paint(const gait_camera *cam, const gait_state *s, uint8_t *grey)
{
    toy_paint_of(toy_model(), cam, s, grey);
}

/* Sensor noise of +-3 grey levels. */
static inline void toy_noise(uint32_t seed, uint8_t *grey)
{
    for (uint32_t i = 0; i < SCENE_PIXELS; i++)
        grey[i] = (uint8_t)(grey[i] + toy_hash(seed, i, 5) % 7 - 3);
}

static inline void toy_shot(int camera, int n, uint8_t *grey)
{
    gait_camera const cam = toy_camera(camera);
    gait_state const s = toy_walk((float)n / 30.0f);
    toy_wall(camera, grey);
    toy_paint(&cam, &s, grey);
    toy_noise((uint32_t)(1000 * camera + n), grey);
}

static inline gait_image toy_image(const uint8_t *grey)
{
    return (gait_image){
        .data = grey, .width = SCENE_W, .height = SCENE_H, .stride = SCENE_W, .format = GAIT_GREY8};
}

static inline gait_frame toy_frame(int n)
{
    return (gait_frame){.utime = 1000000 + (int64_t)n * 1000000 / 30};
}
#endif
