/* projection.h - how a camera or an orthographic view measures a point: two rows g . X = y, linear about a guess. */
#ifndef GAIT_IMAGE_PROJECTION_H
#define GAIT_IMAGE_PROJECTION_H
#include "gait_lift.h"
#include "base/base.h"

typedef struct projection {
    bool perspective;
    double axis[2][3]; /* orthographic */
    double R[9], t[3], focal[2], centre[2];
    gait_camera camera; /* for its lens */
} projection;

typedef struct projection_rows { /* of one point; pixels or metres */
    double g[2][3], y[2];
} projection_rows;

void projection_init(projection *e, const gait_lift_config *cfg);
/* Take the lens distortion out: pixels of a pinhole camera. */
void projection_ideal(const projection *e, const double uv[2], double ideal[2]);
/* Rows of a point near `about`, by the first derivatives of the projection there (orthographic: exact). */
void projection_rows_near(const projection *e, const double ideal[2], const double about[3],
                          projection_rows *out);
/* Rows of a point of which only a rough depth is known: it lies on the ray through the pixel. */
void projection_rows_ray(const projection *e, const double ideal[2], double depth, projection_rows *out);
/* Make the noise white: sd^2 of the observation, `residual` variance of each coordinate of the point.
 * Returns the root of the determinant of the noise. */
double projection_whiten(projection_rows *r, double sd, double residual);
/* Gain of the point's residual by the rows' residuals: K = residual G'(sd^2 I + residual G G')^-1. */
void projection_gain(const projection_rows *r, double sd, double residual, double K[3][2]);
#endif
