/* refit.h - a segment of a stream fitted as a whole to the frames that fall into it. */
#ifndef GAIT_LIFT_REFIT_H
#define GAIT_LIFT_REFIT_H
#include "lift/stream.h"

/* Fit segment `index` whatever was thought of it before: to the points that do not jump, then without those far from
 * where the rest has them.  A search that wild points may have led astray is made again with points that say less.
 * false: numbers out of range. */
bool lift_refit(const lift_table *t, lift_search *search, lift_stream *s, int64_t index);
#endif
