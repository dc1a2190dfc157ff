/* fit.h - fit one whole segment: iterated linearisation, from headings all round and every component of the
 * mixture. */
#ifndef GAIT_LIFT_FIT_H
#define GAIT_LIFT_FIT_H
#include "lift/segment_posterior.h"

/* Headings from which the search for an unknown one starts, 45 degrees apart, as HEADING_STARTS of
 * python/gait/lift/segment/explain.py.  Each start is refined, so their number hardly matters, as long as every heading
 * is found. */
enum { LIFT_HEADINGS = 8 };

typedef struct lift_trial { /* a component and a heading, refined from one start */
    int32_t component;
    double evidence; /* with the component's weight, nats */
    double heading;
    double *theta; /* n */
} lift_trial;

typedef struct lift_search {
    lift_trial trial[GAIT_MAX_MIXTURE * LIFT_HEADINGS];
    int32_t trials;
    double *before; /* n: theta of the pass before */
} lift_search;

typedef struct lift_window { /* observations of a segment */
    int32_t frames;
    const double *at;      /* frames: their moments in the segment, [0, F - 1] */
    const double *uv, *sd; /* frames x J x 2, ideal; frames x J */
} lift_window;

typedef struct lift_outcome {
    double share; /* of the component among all, by evidence */
    int32_t iterations;
    bool converged;
} lift_outcome;

void lift_search_layout(arena *a, const lift_table *t, lift_search *s);
/* Fit b to the window; b->place is the prior's.  false: numbers out of range. */
bool lift_fit(const lift_table *t, lift_search *s, const lift_window *w, segment_posterior *b,
              lift_outcome *out);
/* Continue the fit from b after the standard deviations of the window have changed. */
bool lift_fit_again(const lift_table *t, lift_search *s, const lift_window *w, segment_posterior *b);
#endif
