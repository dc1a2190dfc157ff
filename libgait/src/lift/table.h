/* table.h - what all segments of a lifter share, a belief about one segment, and where that puts a
 * body.
 *
 * Unknowns theta ~ N(0, 1): k modes, place x y z in their deviations, and, unless they are known, stature and
 * heading in theirs.  A stature off by a share s moves every marker by s of its place in the body: where it is
 * by the modes too, so that a small body near the lens pays as much for them as a large one far away; by the mean
 * in a parallel view, which has no such choice and stays linear. */
#ifndef GAIT_LIFT_TABLE_H
#define GAIT_LIFT_TABLE_H
#include "base/arena.h"
#include "base/cholesky.h"
#include "image/projection.h"
#include "model/segment_prior.h"

typedef struct segment_posterior { /* one segment under one component of the prior */
    int32_t component;
    int32_t observed;       /* numbers */
    double heading;         /* about which the turn is linear, radians */
    double centre, turn_sd; /* prior of the heading */
    double place[3];        /* prior mean of the place, metres */
    double log_noise;       /* log of the determinant of the noise */
    double miss;            /* squared white residuals where it was linearised */
    double *theta;          /* n, ld */
    double *A;              /* normal equations with the prior, dense.h */
    double *U;              /* their factor */
} segment_posterior;

typedef struct lift_seen { /* one frame's observations */
    const double *uv;      /* J x 2, ideal */
    const double *sd;      /* J; not finite or not positive: unseen */
} lift_seen;

typedef struct lift_table { /* sizes and places that every segment shares */
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
    int32_t reported; /* markers of the config's report, the first of: */
    int32_t order[GAIT_MAX_MARKERS];
    int32_t trunk[4]; /* right and left hip, right and left shoulder; -1: the prior does not know it */
    double stature, gamma;
    double growth; /* share of the stature that is one deviation */
    float *row;    /* K x F x J x 3 x lanes: modes, side by side */
    float *column; /* K x F x columns / 8 x 3 x k x 8: the same, eight markers of `order` side by side */
    double *W;     /* 2 J x ld: white rows of a frame */
    double *Z;     /* 3 J x ld: what the unknowns move */
    double *shape; /* 3 x lanes: the modes of one marker at one moment; 3 x k x 8 of eight */
    float *V;      /* ld x (width + ld): what each unknown moves by what is left of it after observing */
} lift_table;

void lift_table_layout(arena *a, lift_table *t);
void lift_table_fill(lift_table *t);
void segment_posterior_layout(arena *a, const lift_table *t, segment_posterior *b);

static inline bool lift_seen_at(const lift_seen *s, int32_t j)
{
    return s->sd[j] > 0.0 && s->sd[j] <= DBL_MAX && fabs(s->uv[2 * j]) <= DBL_MAX &&
           fabs(s->uv[2 * j + 1]) <= DBL_MAX;
}

/* Where the belief has the heading now. */
double lift_heading(const lift_table *t, const segment_posterior *b);

/* A moment between two frames: (1 - part) of frame f and part of frame `next`. */
typedef struct lift_moment {
    int32_t f, next;
    double part;
} lift_moment;

lift_moment lift_find_moment(const lift_table *t, double at); /* at in frames, clamped to [0, F - 1] */

/* Axes of a segment in the world: X = stature Rz(heading) x + place. */
typedef struct lift_axes {
    double c, s; /* stature times cosine and sine */
    double z;    /* stature */
    double place[3];
} lift_axes;

lift_axes lift_axes_prior(const lift_table *t, const segment_posterior *b); /* at the expected place, b->heading */
lift_axes lift_axes_now(const lift_table *t, const segment_posterior *b);   /* by theta */

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
#endif
