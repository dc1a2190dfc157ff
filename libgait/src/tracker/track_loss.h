/* track_loss.h - notice from the images that nobody is where the track is, and find the walker again.
 *
 * Nobody: the frame is explained better without the estimated body than with it.  Until that has lasted
 * for a while nothing changes: whoever is hidden for a moment goes on as predicted, because the
 * likelihood of being hidden bounds that of every particle from below.  After that some of the particles
 * are drawn anew in every frame from a region round the last place that grows with time (after augmented
 * Monte-Carlo localisation; Thrun, Burgard and Fox 2005, 8.3.3).  The transition is then a mixture of
 * following and being elsewhere; more particles are drawn from its second part than its probability, and
 * weigh that much less. */
#ifndef GAIT_TRACKER_TRACK_LOSS_H
#define GAIT_TRACKER_TRACK_LOSS_H
#include "tracker/tracker.h"

bool track_loss_is_lost(const gait_tracker *t);

/* Would the walker, turned round, fit what was seen lately as well, so that the pose is not to be trusted? */
bool track_loss_doubts_front(const gait_tracker *t);

/* After the prediction: while lost, draw some particles anew.  The others are even, as resampled. */
void track_loss_search(gait_tracker *t, uint32_t frame);

/* Bound t->ll from below by that of a hidden walker. */
void track_loss_allow_hidden(gait_tracker *t);

/* Take note of whether the frame supports the estimated walker. */
void track_loss_update(gait_tracker *t, const particle_state *mean);
#endif
