/* The limbs of a block before a camera: which half can face it, and how points and normals show in its picture. */
#include "image/camera.h"
#include "base/dispatch.h"
#include "base/simd16.h"
#include "likelihood/likelihood.h"
#include <string.h>

/* Of the directions 0 .. 7 and their opposites 8 .. 15, those on one side of a plane through the limb follow
 * one another: `count` of the first eight lie there, and the last of these does or does not. */
static inline int32_t first_direction(int32_t count, int32_t last)
{
    return (LIKE_AZIMUTHS + (last ? -count : count)) & (LIKE_DIRECTIONS - 1);
}

/* A normal is across the limb's axis, so what counts is the direction in which the camera sees the axis: a
 * normal that leads away from the camera there does so at its point, too, a radius further out. */
static void choose_half(const like_surface *s, body_lanes *restrict w, const float *scale,
                        int32_t *restrict turn)
{
    float const grazing = 0.2f; /* |n.v| below which a point grazes the outline */
    for (int32_t i = 0; i < BLOCK; i++) {
        float const stature = 1.0f / scale[i];
        float e[3], m[3]; /* from the camera to the limb's frame and to its middle, in the frame, statures */
        int32_t count = 0, last = 0;
        for (int32_t k = 0; k < 3; k++) {
            e[k] = stature * w[LIKE_VIEW_EYE + k][i];
            m[k] = e[k] + s->middle[k];
            w[LIKE_VIEW_EYE + k][i] = e[k];
        }
        for (int32_t d = 0; d < LIKE_AZIMUTHS; d++) {
            last = s->side[0][d] * m[0] + s->side[1][d] * m[1] + s->side[2][d] * m[2] < 0.0f;
            count += last;
        }
        turn[i] = first_direction(count, last);
        w[LIKE_VIEW_GRAZE][i] = -grazing * __builtin_sqrtf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
    }
}

/* A limb's frame and its origin in the camera's axes. */
static void to_camera(const gait_camera *cam, const body_lanes *R, const body_lanes *o,
                      body_lanes *restrict turn, body_lanes *restrict place)
{
    for (int32_t r = 0; r < 3; r++) {
        const float *const c = cam->R + 3 * r;
        for (int32_t k = 0; k < 3; k++)
            for (int32_t i = 0; i < BLOCK; i++)
                turn[3 * r + k][i] = c[0] * R[k][i] + c[1] * R[3 + k][i] + c[2] * R[6 + k][i];
        for (int32_t i = 0; i < BLOCK; i++)
            place[r][i] = c[0] * o[0][i] + c[1] * o[1][i] + c[2] * o[2][i] + cam->t[r];
    }
}

/* What takes a row of camera coordinates, x or y, and depth to 1/256 working pixels times depth. */
static void to_image(float focus, float middle, const float *row, const float *depth, float *restrict out)
{
    for (int32_t i = 0; i < BLOCK; i++)
        out[i] = focus * row[i] + middle * depth[i];
}

void KERNEL(surface_pose)(const like_setup *s, const gait_camera *cam, const view_map *map,
                          const kin_body *body, like_pose *restrict out)
{
    float const unit = (float)LIKE_SUBPIXELS * map->scale;
    float const focus[2] = {unit * cam->fx, unit * cam->fy};
    float const middle[2] = {unit * (cam->cx - map->u0), unit * (cam->cy - map->v0)};
    for (int32_t l = 0; l < s->limbs; l++) {
        int32_t const f = s->geometry[l].frame;
        const float *const scale = body->scale[f];
        body_lanes R[9], t[3], w[LIKE_WORDS];
        to_camera(cam, body->R[f], body->o[f], R, t);
        for (int32_t k = 0; k < 3; k++) {
            for (int32_t i = 0; i < BLOCK; i++) {
                w[LIKE_VIEW_EYE + k][i] = R[k][i] * t[0][i] + R[3 + k][i] * t[1][i] + R[6 + k][i] * t[2][i];
                R[k][i] *= scale[i];
                R[3 + k][i] *= scale[i];
                R[6 + k][i] *= scale[i];
            }
            memcpy(w[LIKE_VIEW_IMAGE + 6 + k], R[6 + k], sizeof R[k]);
            for (int32_t r = 0; r < 2; r++)
                to_image(focus[r], middle[r], R[3 * r + k], R[6 + k], w[LIKE_VIEW_IMAGE + 3 * r + k]);
        }
        memcpy(w[LIKE_VIEW_SHIFT + 2], t[2], sizeof t[2]);
        for (int32_t r = 0; r < 2; r++)
            to_image(focus[r], middle[r], t[r], t[2], w[LIKE_VIEW_SHIFT + r]);
        choose_half(&s->surface[l], w, scale, out->limb[l].turn);
        simd16_deal((const body_lanes *)w, out->limb[l].view);
    }
}
