/* eye.h - how a camera or an orthographic view measures a point: two rows g . X = y, linear about a guess. */
#ifndef GAIT_EYE_H
#define GAIT_EYE_H
#include "base.h"

typedef struct eye {
    bool perspective;
    double axis[2][3]; /* orthographic */
    double R[9], t[3], focal[2], centre[2];
    gait_camera camera; /* for its lens */
} eye;

typedef struct eye_rows { /* of one point; pixels or metres */
    double g[2][3], y[2];
} eye_rows;

void eye_open(eye *e, const gait_lift_config *cfg);
/* Take the lens distortion out: pixels of a pinhole camera. */
void eye_ideal(const eye *e, const double uv[2], double ideal[2]);
/* Rows of a point near `about`, by the first derivatives of the projection there (orthographic: exact). */
void eye_rows_near(const eye *e, const double ideal[2], const double about[3], eye_rows *out);
/* Rows of a point of which only a rough depth is known: it lies on the ray through the pixel. */
void eye_rows_ray(const eye *e, const double ideal[2], double depth, eye_rows *out);
/* Make the noise white: sd^2 of the observation, `residual` variance of each coordinate of the point.
 * Returns the root of the determinant of the noise. */
double eye_whiten(eye_rows *r, double sd, double residual);
/* Gain of the point's residual by the rows' residuals: K = residual G'(sd^2 I + residual G G')^-1. */
void eye_gain(const eye_rows *r, double sd, double residual, double K[3][2]);
#endif
