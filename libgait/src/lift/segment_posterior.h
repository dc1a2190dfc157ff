/* segment_posterior.h - the posterior of one segment of motion given 2-D observations.
 *
 * Leventon and Freeman (1998), eqs. 5 and 6 in information form: (I + G'R^-1 G) theta = G'R^-1 (y - P m).
 * Unknowns theta ~ N(0, 1): k modes, place x y z, and, unless they are known, stature and heading, each divided by
 * its standard deviation.  If the stature is wrong by a share s, every marker moves by s times its position in the body.
 * With a perspective camera that position includes the modes, so that they are as probable for a small body near the lens
 * as for a large one far away; in an orthographic view, which cannot confuse the two, it is that of the mean, and the
 * model stays linear. */
#ifndef GAIT_LIFT_SEGMENT_POSTERIOR_H
#define GAIT_LIFT_SEGMENT_POSTERIOR_H
#include "base/arena.h"
#include "base/cholesky.h"
#include "image/projection.h"
#include "model/segment_prior.h"

typedef struct segment_posterior { /* of one component of the prior */
    int32_t component;
    int32_t observed;       /* numbers observed: two per point */
    double heading;         /* about which the model is linearised, radians */
    double centre, turn_sd; /* prior of the heading */
    double place[3];        /* prior mean of the place, metres */
    double log_noise;       /* log of the determinant of the noise */
    double chi2;            /* squared white residuals where it was linearised */
    double *theta;          /* n, ld */
    double *A;              /* normal equations with the prior, cholesky.h */
    double *U;              /* their factor */
} segment_posterior;

typedef struct lift_observations { /* of one frame */
    const double *uv;              /* J x 2, ideal */
    const double *sd;              /* J; not finite or not positive: not observed */
} lift_observations;

typedef struct lift_table { /* what all segments of a lifter share */
    segment_prior prior;
    gait_lift_config cfg;
    projection projection;
    const kernels *run;
    int32_t n, ld;    /* unknowns; padded n + 1 */
    int32_t size;     /* index of the stature, -1: known */
    int32_t turn;     /* index of the heading, the last; -1: known */
    int32_t lanes;    /* modes padded */
    int32_t columns;  /* J padded */
    int32_t width;    /* 3 columns padded */
    int32_t reported; /* number of markers in the config's `report`, the first of `order` */
    int32_t order[GAIT_MAX_MARKERS];
    int32_t trunk[4]; /* right and left hip, right and left shoulder; -1: not in the prior */
    double stature, gamma;
    double growth; /* standard deviation of the stature, relative to it */
    float *row;    /* K x F x J x 3 x lanes: modes, side by side */
    float *column; /* K x F x columns / 8 x 3 x k x 8: the same, eight markers of `order` side by side */
    double *W;     /* 2 J x ld: white rows of a frame */
    double *Z;     /* 3 J x ld: displacements by the unknowns */
    double *shape; /* 3 x lanes: the modes of one marker at one moment; 3 x k x 8 of eight */
    float
        *V; /* ld x (width + ld): displacements by the unknowns, times their remaining standard deviations */
} lift_table;

void lift_table_layout(arena *a, lift_table *t);
void lift_table_fill(lift_table *t);
void segment_posterior_layout(arena *a, const lift_table *t, segment_posterior *b);

static inline bool lift_observed(const double uv[2], double sd)
{
    return sd > 0.0 && sd <= DBL_MAX && fabs(uv[0]) <= DBL_MAX && fabs(uv[1]) <= DBL_MAX;
}

static inline bool lift_observed_at(const lift_observations *o, int32_t j)
{
    return lift_observed(o->uv + 2 * j, o->sd[j]);
}

/* Present estimate of the heading. */
double lift_heading(const lift_table *t, const segment_posterior *b);

/* A moment between two frames: (1 - share) of frame f and share of frame `next`. */
typedef struct lift_moment {
    int32_t f, next;
    double share;
} lift_moment;

lift_moment lift_find_moment(const lift_table *t, double at); /* at in frames, clamped to [0, F - 1] */

/* Axes of a segment in the world: X = stature Rz(heading) x + place. */
typedef struct lift_axes {
    double c, s; /* stature times cosine and sine */
    double z;    /* stature */
    double place[3];
} lift_axes;

/* At the expected place, heading b->heading. */
lift_axes lift_axes_prior(const lift_table *t, const segment_posterior *b);

static inline void lift_to_world(const lift_axes *f, const double x[3], double out[3])
{
    out[0] = f->c * x[0] - f->s * x[1] + f->place[0];
    out[1] = f->s * x[0] + f->c * x[1] + f->place[1];
    out[2] = f->z * x[2] + f->place[2];
}

/* Variance of each coordinate of marker j outside the modes, square metres. */
static inline double lift_residual(const lift_table *t, const segment_posterior *b, int32_t j)
{
    double const psi = (double)t->prior.residual[b->component * t->prior.markers + j];
    return t->gamma * psi * t->stature * t->stature;
}

typedef struct lift_residuals { /* of the markers observed in a frame */
    double *position;           /* J x 3, by theta */
    double *square;             /* squared white residuals of their rows */
} lift_residuals;

/* Normal equations of the prior alone. */
void lift_clear(const lift_table *t, segment_posterior *b);
/* White rows t->W of a frame at moment `at`, in frames [0, F - 1]; returns how many.  They are linearised about guess
 * (J x 3, read only where observed); if it is NULL, about theta, or with depth > 0 about nothing but that rough depth.
 * residuals may be NULL. */
int32_t lift_rows(const lift_table *t, segment_posterior *b, double at, const lift_observations *observed,
                  const double *guess, double depth, const lift_residuals *residuals);
/* The same, added to the equations. */
void lift_add(const lift_table *t, segment_posterior *b, double at, const lift_observations *observed,
              const double *guess, double depth);
/* Solve for theta; false: not positive definite (numbers out of range). */
bool lift_solve(const lift_table *t, segment_posterior *b);
/* log p(observations), nats. */
double lift_evidence(const lift_table *t, const segment_posterior *b);
/* Sum of squared residuals in standard deviations; after lift_solve(). */
double lift_chi2(const lift_table *t, const segment_posterior *b);

typedef struct lift_query {
    double at;     /* moment, frames */
    int32_t count; /* markers, the first of t->order */
    const lift_observations
        *observed; /* at exactly that moment, for the part outside the modes; NULL: none */
} lift_query;

/* Posterior mean (count x 3) and standard deviation (may be NULL) of markers at a moment. */
void lift_read(const lift_table *t, const segment_posterior *b, const lift_query *q, double *mean,
               double *sd);
/* Posterior mean (count x 3) of any markers at a moment, without the part outside the modes. */
void lift_positions(const lift_table *t, const segment_posterior *b, double at, const int32_t *marker,
                    int32_t count, double *mean);
/* Displacement of every marker by one standard deviation of each unknown: 3 J rows of t->Z, n numbers each. */
void lift_modes(const lift_table *t, const segment_posterior *b, double at);
#endif
