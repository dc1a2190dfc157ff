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

/* False for NaN. */
static bool within(const float *x, int count, float low, float high)
{
    bool ok = true;
    for (int i = 0; i < count; i++)
        ok &= x[i] >= low && x[i] <= high;
    return ok;
}

bool camera_valid(const gait_camera *c)
{
    const float focal[2] = {c->fx, c->fy}, middle[2] = {c->cx, c->cy};
    return c->width > 0 && c->height > 0 && within(focal, 2, 1e-3f, 1e9f) && within(middle, 2, -1e6f, 1e6f) &&
           within(c->t, 3, -1e4f, 1e4f) && within(c->distortion, 5, -1e3f, 1e3f) && rotation_valid(c->R);
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

/* Whether somewhere in the picture a person on the floor would be upright and tall enough to be tracked; lens: position of
 * the lens. */
static bool shows_person(const gait_camera *c, const float lens[3])
{
    enum { ALONG = 9 };
    const double LEAST_TALL = 20.0; /* pixels */
    bool any = false;
    for (int32_t i = 0; i < ALONG * ALONG; i++) {
        double const foot[2] = {(double)(i % ALONG * (c->width - 1)) / (ALONG - 1),
                                (double)(i / ALONG * (c->height - 1)) / (ALONG - 1)};
        double ray[3];
        float head[3] = {0.0f, 0.0f, 1.7f}, uv[2];
        camera_ray(c, foot, ray);
        for (int32_t k = 0; k < 2; k++)
            head[k] = lens[k] - (float)((double)lens[2] * ray[k] / ray[2]);
        if (ray[2] < 0.0 && camera_project(c, head, uv) > CAMERA_NEAR) {
            double const tall = foot[1] - (double)uv[1];
            any |= tall > LEAST_TALL && fabs(foot[0] - (double)uv[0]) < tall;
        }
    }
    return any;
}

gait_result camera_check_place(const gait_camera *c, gait_error *err)
{
    const float LEAST = 0.05f, MOST = 200.0f; /* metres of a lens over the floor */
    /* Least downward component of the picture's downward direction: a camera in a world with y up, which looks along z,
     * would seem to look straight down. */
    const float LEAST_DOWN = 0.17f;
    const float *const down = c->R + 3;
    float lens[3] = {0.0f, 0.0f, 0.0f};
    int32_t axis = 0;
    camera_to(c, lens, lens); /* from the lens to the origin */
    for (int32_t k = 0; k < 3; k++) {
        lens[k] = -lens[k];
        axis = fabsf(down[k]) > fabsf(down[axis]) ? k : axis;
    }
    if (lens[2] >= LEAST && lens[2] <= MOST && down[2] < -LEAST_DOWN && shows_person(c, lens))
        return GAIT_OK;
    return base_fail(
        err, GAIT_ERR_ARG, -1,
        "no standing person would be upright: lens %.4g m above the floor, %c%c up; give R and t "
        "in metres, z up, floor z = 0",
        (double)lens[2] + 0.0, down[axis] > 0.0f ? '-' : '+', 'x' + axis);
}
