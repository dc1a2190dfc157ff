#include "camera.h"

#include "vec.h"

/* Rows of R are unit vectors at right angles, to 1e-3, and right-handed. */
static bool rotation_valid(const float R[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = i; j < 3; j++)
            if (!(fabsf(v3_dot(R + 3 * i, R + 3 * j) - (i == j ? 1.0f : 0.0f)) <= 1e-3f))
                return false;
    return m3_det(R) > 0.0f;
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
