/* lifter.h - the public object: everything a lifter needs, in one block. */
#ifndef GAIT_LIFT_LIFTER_H
#define GAIT_LIFT_LIFTER_H
#include "lift/batch.h"
#include "lift/stream.h"

struct gait_lift {
    lift_table table;
    lift_search search;
    segment_posterior posterior, spare; /* of the last segment; scratch */
    lift_window window;                 /* of the last segment */
    double *at, *uv, *sd;               /* of the window: F; F x J x 2; F x J */
    lift_robust robust;
    lift_gain gain;
    lift_stream stream;
    bool any_heading;      /* initialised for an unknown heading */
    bool fitted, windowed; /* there is a posterior; it is of observations, not of gait_lift_fix() */
};

/* Place everything; NULL when counting or if the arena is too small. */
gait_lift *lifter_layout(arena *a, const segment_prior *prior, const gait_lift_config *cfg,
                         const kernels *run);
/* Convert observations of `points` markers to ideal pixels with a standard deviation each; sd NULL: the config's. */
void lifter_take(const gait_lift *l, size_t points, const double *uv, const double *sd, double *to_uv,
                 double *to_sd);
#endif
