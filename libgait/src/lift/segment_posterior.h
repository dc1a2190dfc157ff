/* segment_posterior.h - normal equations of one segment and their solution.
 *
 * Leventon and Freeman (1998), eqs. 5 and 6 in information form: (I + G'R^-1 G) theta = G'R^-1 (y - P m). */
#ifndef GAIT_LIFT_SEGMENT_POSTERIOR_H
#define GAIT_LIFT_SEGMENT_POSTERIOR_H
#include "lift/table.h"

typedef struct lift_marker { /* linear about theta, statures */
    double base[3];          /* with no modes and no growth */
    double shape[3];         /* what grows with the stature */
    double grown;            /* factor of the modes */
} lift_marker;

/* Marker j, its modes in t->shape, and in x where theta has it.  In a parallel view the mean alone grows: all
 * is linear. */
void lift_marker_at(const lift_table *t, const segment_posterior *b, const lift_moment *m, int32_t j,
                    lift_marker *r, double x[3]);
/* The same without t->shape: theta moves the marker so far. */
void lift_marker_moved(const lift_table *t, const segment_posterior *b, const lift_moment *m, int32_t j,
                       const double moved[3], lift_marker *r, double x[3]);
/* Normal equations of the prior alone. */
void lift_clear(const lift_table *t, segment_posterior *b);
typedef struct lift_residuals { /* what a belief says of the markers seen in a frame */
    double *place;         /* J x 3 */
    double *square;        /* squared white residuals of their rows */
} lift_residuals;

/* White rows t->W of a frame at moment `at`, in frames [0, F - 1]; returns how many. They are linearised
 * about guess (J x 3, what is unseen is not read); NULL: about what theta says; depth > 0: about nothing
 * but a rough depth. said may be NULL. */
int32_t lift_rows(const lift_table *t, segment_posterior *b, double at, const lift_seen *seen, const double *guess,
                  double depth, const lift_residuals *said);
/* The same, added to the equations. */
void lift_add(const lift_table *t, segment_posterior *b, double at, const lift_seen *seen, const double *guess,
              double depth);
/* Solve for theta; false: not positive definite (numbers out of range). */
bool lift_solve(const lift_table *t, segment_posterior *b);
/* log p(observations), nats. */
double lift_evidence(const lift_table *t, const segment_posterior *b);
#endif
