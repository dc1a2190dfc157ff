#include "image/camera.h"

static float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static float determinant(const float m[9])
{
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
}

/* True if the rows of R are orthonormal to 1e-3 and right-handed. */
static bool rotation_valid(const float R[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = i; j < 3; j++)
            if (!(fabsf(dot(R + 3 * i, R + 3 * j) - (i == j ? 1.0f : 0.0f)) <= 1e-3f))
                return false;
    return determinant(R) > 0.0f;
}

bool camera_valid(const gait_camera *c)
{
    const float intrinsics[4] = {c->fx, c->fy, c->cx, c->cy};
    return c->width > 0 && c->height > 0 && f_finite(intrinsics, 4) && c->fx > 0.0f && c->fy > 0.0f &&
           f_finite(c->R, 9) && f_finite(c->t, 3) && f_finite(c->distortion, 5) && rotation_valid(c->R);
}

bool camera_distorted(const gait_camera *c)
{
    bool any = false;
    for (int i = 0; i < 5; i++)
        any |= c->distortion[i] != 0.0f;
    return any;
}

/* Iterate ideal = (distorted - tangential) / radial. */
void camera_ideal(const gait_camera *c, const double distorted[2], double ideal[2])
{
    enum { PASSES = 40 };
    double d[5];
    for (int32_t i = 0; i < 5; i++)
        d[i] = (double)c->distortion[i];
    double const fx = (double)c->fx, fy = (double)c->fy, cx = (double)c->cx, cy = (double)c->cy;
    double const xd = (distorted[0] - cx) / fx, yd = (distorted[1] - cy) / fy;
    double x = xd, y = yd;
    ideal[0] = distorted[0];
    ideal[1] = distorted[1];
    if (!camera_distorted(c))
        return;
    for (int32_t i = 0; i < PASSES; i++) {
        double const r2 = x * x + y * y, xy2 = 2.0 * x * y;
        double const radial = 1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
        x = (xd - d[2] * xy2 - d[3] * (r2 + 2.0 * x * x)) / radial;
        y = (yd - d[2] * (r2 + 2.0 * y * y) - d[3] * xy2) / radial;
    }
    ideal[0] = fx * x + cx;
    ideal[1] = fy * y + cy;
}
