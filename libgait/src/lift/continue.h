/* continue.h - the segment after a segment: where its prior stands. */
#ifndef GAIT_LIFT_CONTINUE_H
#define GAIT_LIFT_CONTINUE_H
#include "lift/read.h"

/* Prior of component c of the next segment, from what `before` says of its frame `hop`: heading turned on
 * by as much as the body has turned, the body's middle where it will be. spare: J x 3. */
void lift_continue(const lift_table *t, const segment_posterior *before, int32_t c, segment_posterior *next,
                   double *spare);
/* Squared residuals in deviations, of a solved belief. */
double lift_misfit(const lift_table *t, const segment_posterior *b);
#endif
