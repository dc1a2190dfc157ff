/* read.h - what a belief says of one moment. */
#ifndef GAIT_LIFT_READ_H
#define GAIT_LIFT_READ_H
#include "lift/table.h"

typedef struct lift_query { /* what is asked of a moment */
    double at;              /* frames */
    int32_t count;          /* markers, the first of t->order */
    const lift_seen
        *seen; /* the observations of that very moment, for the part outside the modes; NULL: none */
} lift_query;

/* Posterior mean (count x 3) and standard deviation (may be NULL) of markers at a moment. */
void lift_read(const lift_table *t, const segment_posterior *b, const lift_query *q, double *mean, double *sd);
/* Posterior mean (count x 3) of any markers at a moment, without the part outside the modes. */
void lift_places(const lift_table *t, const segment_posterior *b, double at, const int32_t *marker, int32_t count,
                 double *mean);
/* Displacement of every marker by one deviation of each unknown: 3 J rows of t->Z, n numbers each. */
void lift_modes(const lift_table *t, const segment_posterior *b, double at);
#endif
