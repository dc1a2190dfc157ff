/* projection.h - observation model of a 3-D point in a camera or an orthographic view: two rows g . X = y,
 * linearised about a point. */
#ifndef GAIT_IMAGE_PROJECTION_H
#define GAIT_IMAGE_PROJECTION_H
#include "gait_lift.h"
#include "base/base.h"

typedef struct projection {
    bool perspective;
    double axis[2][3]; /* orthographic */
    double R[9], t[3], focal[2], centre[2];
    gait_camera camera; /* for its lens distortion */
} projection;

typedef struct projection_rows { /* the rows of one point; pixels or metres */
    double g[2][3], y[2];
} projection_rows;

void projection_init(projection *e, const gait_lift_config *cfg);
/* Remove the lens distortion: pixels of the pinhole camera. */
void projection_ideal(const projection *e, const double uv[2], double ideal[2]);
/* Rows of a point, linearised at `about` (exact if orthographic). */
void projection_rows_near(const projection *e, const double ideal[2], const double about[3],
                          projection_rows *out);
/* Rows of a point whose depth is known only roughly: they place it on the ray through the pixel. */
void projection_rows_ray(const projection *e, const double ideal[2], double depth, projection_rows *out);
/* Whiten the rows: sd is the noise of the observation, `residual` the variance of each coordinate of the
 * point. Returns the square root of the determinant of the noise covariance. */
double projection_whiten(projection_rows *r, double sd, double residual);
/* Kalman gain of the point for the residuals of its rows: K = residual G'(sd^2 I + residual G G')^-1. */
void projection_gain(const projection_rows *r, double sd, double residual, double K[3][2]);
#endif
