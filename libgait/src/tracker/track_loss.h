/* track_loss.h - notice that the images no longer support the track, and search for the person again.
 *
 * A frame does not support the estimate if it is explained better without the body than with it.  For a while that changes
 * nothing: an occluded person is tracked as predicted, because the likelihood of being hidden bounds that of every particle
 * from below.  After that, in every frame, some particles are redrawn from a region around the last supported place that
 * grows with time (as in augmented Monte-Carlo localisation; Thrun, Burgard and Fox 2005, 8.3.3).  The transition is then a
 * mixture of walking on and of being elsewhere; more particles are drawn from the second component than its probability
 * warrants, with correspondingly smaller weights. */
#ifndef GAIT_TRACKER_TRACK_LOSS_H
#define GAIT_TRACKER_TRACK_LOSS_H
#include "tracker/tracker_state.h"

bool track_loss_is_lost(const gait_tracker *t);

/* After the prediction, while lost: redraw some particles.  The weights must be even, as after resampling. */
void track_loss_redraw(gait_tracker *t, uint32_t counter);

/* After the likelihood step: loglik from loglik_raw, bounded below by the log-likelihood of a hidden person. */
void track_loss_bound(gait_tracker *t);

typedef enum track_loss_support { SUPPORT_NONE, SUPPORT_PART, SUPPORT_WHOLE } track_loss_support;
typedef struct track_loss_verdict {
    track_loss_support support; /* SUPPORT_PART: only foreground that some parts of the body explain */
    float by_images;            /* log-likelihood ratio of the images alone against an empty scene, nats */
    float usual_unexplained;    /* new value of the state's */
    bool phase_as_predicted;    /* the phase follows from that of the last supported estimate */
    bool phase_expired;         /* that estimate is too old to predict from */
} track_loss_verdict;

/* Whether the frame supports the estimate, of the class of layout `of`.  Writes the estimate's surface samples to t->estimate_patch. */
track_loss_verdict track_loss_check(gait_tracker *t, bool lost, const state_layout *of,
                                    const particle_state *mean);
#endif
