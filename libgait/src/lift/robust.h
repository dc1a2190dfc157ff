/* lift_robust_weights.h - points that a detector put elsewhere: on the other leg, on somebody else.
 *
 * A point far from where a belief has it loses its say: beyond `far` its deviation grows with the square of its
 * distance, so that its pull falls with the third power.  Nearer points keep theirs.  Where half of a frame's
 * points are off, as when somebody does what nobody expected, far means far beyond those. */
#ifndef GAIT_LIFT_ROBUST_H
#define GAIT_LIFT_ROBUST_H
#include "lift/segment_posterior.h"

/* Deviations sd (J) for the points seen in a frame.  Distances count in the deviations of the points and, of those that
 * the belief does not know yet, of its prediction.  place (J x 3) receives where it has those seen.
 * Returns how many points are doubted. */
int32_t lift_robust_weights(const lift_table *t, const segment_posterior *b, double at, const lift_seen *seen, bool known,
                   double *place, double *sd);
#endif
