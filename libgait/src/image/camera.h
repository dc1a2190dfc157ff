/* camera.h - pinhole projection and lens distortion, with the conventions of gait_camera in gait.h. */
#ifndef GAIT_IMAGE_CAMERA_H
#define GAIT_IMAGE_CAMERA_H
#include "base/base.h"
#include <string.h>

#define CAMERA_NEAR 0.05f /* metres: points nearer than this are not projected */

/* True if the size is positive, every number in the range that gait.h gives, and R orthonormal to 1e-3 with det R > 0. */
bool camera_valid(const gait_camera *c);

/* GAIT_ERR_ARG unless the pose of a valid camera is plausible, as described at gait_camera_check(). */
gait_result camera_check_place(const gait_camera *c, gait_error *err);

/* True if some distortion coefficient is not 0. */
bool camera_distorted(const gait_camera *c);

/* Ideal pixel (u, v) to the pixel of the captured image (OpenCV's k1 k2 p1 p2 k3). */
static inline void camera_distort(const gait_camera *c, float u, float v, float *ud, float *vd)
{
    const float *const d = c->distortion; /* k1 k2 p1 p2 k3 */
    float const x = (u - c->cx) / c->fx, y = (v - c->cy) / c->fy;
    float const r2 = x * x + y * y, xy2 = 2.0f * x * y;
    float const radial = 1.0f + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
    float const xd = x * radial + d[2] * xy2 + d[3] * (r2 + 2.0f * x * x);
    float const yd = y * radial + d[2] * (r2 + 2.0f * y * y) + d[3] * xy2;
    *ud = c->fx * xd + c->cx;
    *vd = c->fy * yd + c->cy;
}

/* The inverse: a pixel of the captured image to the ideal pixel, by fixed-point iteration, which converges
 * for lenses within their image. */
void camera_ideal(const gait_camera *c, const double distorted[2], double ideal[2]);

/* Direction of an ideal pixel's ray in the world, of length 1 along the optical axis. */
static inline void camera_ray(const gait_camera *c, const double ideal[2], double ray[3])
{
    double const x = (ideal[0] - (double)c->cx) / (double)c->fx,
                 y = (ideal[1] - (double)c->cy) / (double)c->fy;
    for (int32_t k = 0; k < 3; k++)
        ray[k] = (double)c->R[k] * x + (double)c->R[3 + k] * y + (double)c->R[6 + k];
}

/* The same camera with another pose. */
static inline gait_camera camera_placed(const gait_camera *c, const float R[9], const float t[3])
{
    gait_camera out = *c;
    memcpy(out.R, R, sizeof out.R);
    memcpy(out.t, t, sizeof out.t);
    return out;
}

/* Vector from the camera centre to the point p, both in the world, metres. */
static inline void camera_to(const gait_camera *c, const float p[3], float ray[3])
{
    for (int32_t k = 0; k < 3; k++)
        ray[k] = p[k] + c->R[k] * c->t[0] + c->R[3 + k] * c->t[1] + c->R[6 + k] * c->t[2];
}

/* World point to ideal pixel. Returns its depth Z; uv is not written if Z <= CAMERA_NEAR. */
static inline float camera_project(const gait_camera *c, const float p[3], float uv[2])
{
    const float *const R = c->R;
    float const x = R[0] * p[0] + R[1] * p[1] + R[2] * p[2] + c->t[0];
    float const y = R[3] * p[0] + R[4] * p[1] + R[5] * p[2] + c->t[1];
    float const z = R[6] * p[0] + R[7] * p[1] + R[8] * p[2] + c->t[2];
    if (z > CAMERA_NEAR) {
        float const inv = 1.0f / z;
        uv[0] = c->fx * (x * inv) + c->cx;
        uv[1] = c->fy * (y * inv) + c->cy;
    }
    return z;
}
#endif
