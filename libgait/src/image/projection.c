#include "image/projection.h"

#include "image/camera.h"
#include "base/fmath.h"

#define NEAREST 0.1 /* metres in front of the camera: the smallest depth used */

void projection_init(projection *e, const gait_lift_config *cfg)
{
    const gait_camera *const c = &cfg->camera;
    *e = (projection){.perspective = cfg->projection == GAIT_LIFT_PERSPECTIVE, .camera = *c};
    for (int32_t i = 0; i < 6; i++)
        e->axis[i / 3][i % 3] = cfg->axis[i / 3][i % 3];
    for (int32_t i = 0; i < 9; i++)
        e->R[i] = (double)c->R[i];
    for (int32_t i = 0; i < 3; i++)
        e->t[i] = (double)c->t[i];
    e->focal[0] = (double)c->fx;
    e->focal[1] = (double)c->fy;
    e->centre[0] = (double)c->cx;
    e->centre[1] = (double)c->cy;
}

void projection_ideal(const projection *e, const double uv[2], double ideal[2])
{
    ideal[0] = uv[0];
    ideal[1] = uv[1];
    if (e->perspective)
        camera_ideal(&e->camera, uv, ideal);
}

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void projection_rows_near(const projection *e, const double ideal[2], const double about[3],
                          projection_rows *out)
{
    double const depth = dot3(e->R + 6, about) + e->t[2], z = depth > NEAREST ? depth : NEAREST;
    for (int32_t a = 0; a < 2; a++) {
        const double *const R = e->R + 3 * a;
        double const x = (dot3(R, about) + e->t[a]) / z;
        for (int32_t i = 0; i < 3; i++)
            out->g[a][i] = e->perspective ? (R[i] - x * e->R[6 + i]) * (e->focal[a] / z) : e->axis[a][i];
        double const miss = ideal[a] - (x * e->focal[a] + e->centre[a]);
        out->y[a] = e->perspective ? miss + dot3(out->g[a], about) : ideal[a];
    }
}

void projection_rows_ray(const projection *e, const double ideal[2], double depth, projection_rows *out)
{
    for (int32_t a = 0; a < 2; a++) {
        double const x = (ideal[a] - e->centre[a]) / e->focal[a], scale = e->focal[a] / depth;
        for (int32_t i = 0; i < 3; i++)
            out->g[a][i] = e->perspective ? (e->R[3 * a + i] - x * e->R[6 + i]) * scale : e->axis[a][i];
        out->y[a] = e->perspective ? (x * e->t[2] - e->t[a]) * scale : ideal[a];
    }
}

/* Lower Cholesky factor of the noise covariance. */
static void noise_root(const projection_rows *r, double sd, double residual, double *l11, double *l21,
                       double *l22)
{
    double const variance = sd * sd;
    *l11 = sqrt(variance + residual * dot3(r->g[0], r->g[0]));
    *l21 = residual * dot3(r->g[0], r->g[1]) / *l11;
    double const rest = variance + residual * dot3(r->g[1], r->g[1]) - *l21 * *l21;
    *l22 = sqrt(rest > DBL_MIN ? rest : DBL_MIN);
}

double projection_whiten(projection_rows *r, double sd, double residual)
{
    double l11, l21, l22;
    noise_root(r, sd, residual, &l11, &l21, &l22);
    for (int32_t i = 0; i < 3; i++) {
        r->g[0][i] /= l11;
        r->g[1][i] = (r->g[1][i] - l21 * r->g[0][i]) / l22;
    }
    r->y[0] /= l11;
    r->y[1] = (r->y[1] - l21 * r->y[0]) / l22;
    return l11 * l22;
}

void projection_gain(const projection_rows *r, double sd, double residual, double K[3][2])
{
    double l11, l21, l22;
    noise_root(r, sd, residual, &l11, &l21, &l22);
    for (int32_t i = 0; i < 3; i++) {
        double const w0 = r->g[0][i] / l11, w1 = (r->g[1][i] - l21 * w0) / l22;
        K[i][1] = residual * w1 / l22;
        K[i][0] = residual * (w0 - l21 * (w1 / l22)) / l11;
    }
}
