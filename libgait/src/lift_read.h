/* lift_read.h - what a belief says of one moment. */
#ifndef GAIT_LIFT_READ_H
#define GAIT_LIFT_READ_H
#include "lift_table.h"

typedef struct lift_query { /* what is asked of a moment */
    double at;              /* frames */
    const int32_t *marker;  /* count of them */
    int32_t count;
    const lift_seen
        *seen; /* the observations of that very moment, for the part outside the modes; NULL: none */
} lift_query;

/* Posterior mean (count x 3) and standard deviation (may be NULL) of markers at a moment. */
void lift_read(const lift_table *t, const lift_belief *b, const lift_query *q, double *mean, double *sd);
/* Displacement of one deviation of each unknown: n rows of t->Z, markers as asked and padded; mean as above without
 * the part outside the modes. */
void lift_modes(const lift_table *t, const lift_belief *b, const lift_query *q, double *mean);
#endif
