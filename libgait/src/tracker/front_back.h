/* front_back.h - check that the images show the front of the body where the estimate has it.
 *
 * A person walking backwards, or standing, is also supported by the images, since the body is in the right place.  But
 * its outline then follows the image edges no better than that of a body turned by 180 degrees at some phase.  Scores are
 * relative to the edge strength that a line of random direction would meet, so contrast and clutter do not matter. */
#ifndef GAIT_TRACKER_FRONT_BACK_H
#define GAIT_TRACKER_FRONT_BACK_H
#include "tracker/tracker_state.h"

/* Whether a camera sees the person from a side, so that images can distinguish front and back. */
bool front_back_visible(const gait_tracker *t, const particle_state *p);

/* Edge strength along the outline of the body, less that of the best turned body, less half of what exceeds chance:
 * negative if front and back cannot be distinguished.  Mean over cameras that see the person from a side; 0 if there are
 * none.  of: the class of p. */
float front_back_score(gait_tracker *t, const state_layout *of, const particle_state *p);

/* The running mean of the score after this frame; restart: the person has just been found. */
float front_back_update(gait_tracker *t, bool restart, const state_layout *of, const particle_state *mean);
#endif
