/* fit_check.h - check that the images prefer the estimate to clearly different bodies.
 *
 * Motion that the particles do not follow, such as a sharp turn or a run without a model of running, leaves an estimate
 * that overlaps the person and is therefore supported by the images.  But then the same body turned, or a quarter of a
 * stride off, fits as well.  A person behind an object passes the check: no other body fits better there. */
#ifndef GAIT_TRACKER_FIT_CHECK_H
#define GAIT_TRACKER_FIT_CHECK_H
#include "tracker/tracker_state.h"

/* How much better the images support the body than the best of the different ones, nats, summed over the cameras; 0 if no
 * term distinguishes them.  of: the class of p. */
float fit_check_score(gait_tracker *t, const state_layout *of, const particle_state *p);

/* The running mean of the score after this frame; restart: the person has just been found. */
float fit_check_update(gait_tracker *t, bool restart, const state_layout *of, const particle_state *mean);
#endif
