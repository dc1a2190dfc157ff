/* Rows of a view: exact on the ray, the projection's derivatives near a guess; noise made white; the lens
 * undone. */
#include "image/projection.h"

#include "image/camera.h"

#include "check.h"
#include "toy_segment.h"

static gait_lift_config view(void)
{
    gait_lift_config c;
    gait_lift_default(&c);
    c.camera = (gait_camera){.width = 640,
                             .height = 480,
                             .fx = 500,
                             .fy = 510,
                             .cx = 320,
                             .cy = 235,
                             .R = {0.8f, 0.6f, 0, 0, 0, -1, -0.6f, 0.8f, 0},
                             .t = {0.2f, 1.1f, 5},
                             .distortion = {-0.25f, 0.1f, 0.002f, -0.001f, -0.03f}};
    return c;
}

/* Ideal pixel of a world point. */
static void project(const projection *e, const double X[3], double uv[2])
{
    double x[3];
    for (int i = 0; i < 3; i++)
        x[i] = e->R[3 * i] * X[0] + e->R[3 * i + 1] * X[1] + e->R[3 * i + 2] * X[2] + e->t[i];
    for (int i = 0; i < 2; i++)
        uv[i] = e->focal[i] * x[i] / x[2] + e->centre[i];
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void test_lens(void)
{
    gait_lift_config const c = view();
    projection e;
    projection_init(&e, &c);
    for (int u = 10; u < 640; u += 90)
        for (int v = 10; v < 480; v += 90) {
            float ud, vd;
            double ideal[2];
            camera_distort(&c.camera, (float)u, (float)v, &ud, &vd);
            projection_ideal(&e, (const double[2]){(double)ud, (double)vd}, ideal);
            CHECK_NEAR(ideal[0], u, 2e-3); /* camera_distort is float */
            CHECK_NEAR(ideal[1], v, 2e-3);
        }
}

static void test_rows(void)
{
    gait_lift_config const c = view();
    const double X[3] = {0.3, -0.4, 1.2};
    double uv[2], nudged[2];
    projection e;
    projection_rows r;
    projection_init(&e, &c);
    project(&e, X, uv);
    projection_rows_ray(&e, uv, 4.0, &r);
    for (int a = 0; a < 2; a++)
        CHECK_NEAR(dot(r.g[a], X), r.y[a], 1e-10);
    projection_rows_near(&e, (const double[2]){uv[0] + 3, uv[1] - 2}, X, &r);
    CHECK_NEAR(r.y[0] - dot(r.g[0], X), 3.0, 1e-10);
    CHECK_NEAR(r.y[1] - dot(r.g[1], X), -2.0, 1e-10);
    for (int i = 0; i < 3; i++) {
        double Y[3] = {X[0], X[1], X[2]};
        Y[i] += 1e-6;
        project(&e, Y, nudged);
        for (int a = 0; a < 2; a++)
            CHECK_NEAR(r.g[a][i], (nudged[a] - uv[a]) * 1e6, 1e-3);
    }
}

static void test_orthographic(void)
{
    gait_lift_config c = view();
    projection e;
    projection_rows r;
    c.projection = GAIT_LIFT_ORTHOGRAPHIC;
    projection_init(&e, &c);
    projection_rows_near(&e, (const double[2]){0.5, 1.5}, (const double[3]){9, 9, 9}, &r);
    CHECK(r.y[0] == 0.5 && r.y[1] == 1.5 && r.g[0][0] == 1.0 && r.g[1][2] == 1.0 && r.g[0][1] == 0.0);
    double ideal[2];
    projection_ideal(&e, (const double[2]){0.5, 1.5}, ideal);
    CHECK(ideal[0] == 0.5 && ideal[1] == 1.5);
}

/* White rows have the inverse of the noise's covariance, and the gain is residual G' of it. */
static void test_noise(void)
{
    double const sd = 0.7, residual = 0.4;
    const projection_rows raw = {.g = {{1, 0.2, -0.3}, {0.1, 1.3, 0.5}}, .y = {2, -1}};
    projection_rows white = raw;
    double K[3][2];
    double const c11 = sd * sd + residual * dot(raw.g[0], raw.g[0]);
    double const c22 = sd * sd + residual * dot(raw.g[1], raw.g[1]), c12 = residual * dot(raw.g[0], raw.g[1]);
    double const det = c11 * c22 - c12 * c12;
    CHECK_NEAR(projection_whiten(&white, sd, residual), sqrt(det), 1e-14);
    double const want =
        (raw.y[0] * raw.y[0] * c22 - 2 * raw.y[0] * raw.y[1] * c12 + raw.y[1] * raw.y[1] * c11) / det;
    CHECK_NEAR(white.y[0] * white.y[0] + white.y[1] * white.y[1], want, 1e-14);
    projection_gain(&raw, sd, residual, K);
    for (int i = 0; i < 3; i++) {
        CHECK_NEAR(K[i][0], residual * (raw.g[0][i] * c22 - raw.g[1][i] * c12) / det, 1e-14);
        CHECK_NEAR(K[i][1], residual * (raw.g[1][i] * c11 - raw.g[0][i] * c12) / det, 1e-14);
    }
}

int main(void)
{
    test_lens();
    test_rows();
    test_orthographic();
    test_noise();
    return CHECK_DONE();
}
