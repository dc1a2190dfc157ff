/* front_back.h - does the picture tell which way a walker looks?
 *
 * Who walks backwards, or stands, gets support from the images as well: the body lies where the person is.  But then its
 * outline follows the edges no better than that of somebody who looks the other way, in one phase or another.  The edges
 * that a line of any direction would meet are the measure, so contrast and clutter do not matter. */
#ifndef GAIT_TRACKER_FRONT_BACK_H
#define GAIT_TRACKER_FRONT_BACK_H
#include "tracker/tracker.h"

/* By how much more edges the walker's outline meets than that of the walker turned round, in the phase that meets most,
 * less half of what it meets beyond chance: negative if the picture does not tell.  The mean over cameras that see the
 * walker from a side; 0 if there are none. */
float front_back_score(gait_tracker *t, const particle_state *w);
#endif
