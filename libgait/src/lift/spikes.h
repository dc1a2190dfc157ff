/* lift_spikes.h - points that a detector put elsewhere for a frame or two, before anything is known of the motion. */
#ifndef GAIT_LIFT_SPIKES_H
#define GAIT_LIFT_SPIKES_H
#include "lift/fit.h"

typedef struct lift_spikes_scratch { /* as many as frames of a window */
    int32_t *frame;             /* in which a point is seen */
    double *apart;              /* squared distances */
} lift_spikes_scratch;

/* Leave out (sd -1) the points of a window far off the line through the same point's neighbours in time, the furthest
 * first.  The measure is the larger of their noise and of the median of all its distances, which holds its
 * acceleration. */
void lift_spikes_clear(const lift_table *t, const lift_window *w, double *sd, lift_spikes_scratch *room);
#endif
