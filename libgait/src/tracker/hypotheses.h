/* hypotheses.h - left and right: two hypotheses half a stride apart, tracked until the images decide.
 *
 * A mixture of two particle filters (Vermaak, Doucet and Perez 2003).  Each hypothesis owns half of the particles, which
 * are weighted and resampled among themselves, so sampling noise cannot eliminate a hypothesis.  Only the evidence of its
 * particles moves the weight of a hypothesis, from even odds.  In an estimate a particle's weight is the product of its
 * own and that of its hypothesis.
 *
 * The odds leave out the silhouette: the outlines of the two hypotheses differ by errors of the body's shape more than by
 * which leg is in front, and such errors do not average out.  Frames closer together than config evidence_time count
 * less, here as in the particles' weights, because their errors are correlated.
 *
 * Stages: HYPOTHESES_ACQUISITION finds the phase modulo half a stride, HYPOTHESES_TWO decides between left and right,
 * HYPOTHESES_ONE tracks.  After an automatic start with known phases acquisition only chooses among its hypotheses.  Left
 * and right are open even then: a detector may confuse them throughout the second from which the start was found, and the
 * same keypoints would otherwise count twice.  A start by hand with a known phase begins with HYPOTHESES_ONE. */
#ifndef GAIT_TRACKER_HYPOTHESES_H
#define GAIT_TRACKER_HYPOTHESES_H
#include "tracker/tracker_state.h"

#define REPORT_LOG_ODDS 4.5f /* from which left and right are reported as known (probability 0.99) */

/* The phase is open: begin acquisition (in paper mode there is only one hypothesis). */
void hypotheses_acquire(gait_tracker *t);

/* Hypotheses of an automatic start with known phases: begin acquisition of the correct one, except for its side. */
void hypotheses_compare(gait_tracker *t);

/* Left and right are known: one hypothesis. */
void hypotheses_settle(gait_tracker *t);

/* The images have to show the person of an automatic start.  hypotheses_prove() adds to the log odds of a person over no
 * person the log-likelihood ratio of a frame's images, `dt` seconds after the last; 0: no image term applies.  True once
 * the odds are even, as they are from the beginning unless a proof is required. */
void hypotheses_require_proof(gait_tracker *t);
bool hypotheses_prove(gait_tracker *t, float dt, float nats);

/* The person is lost: treat the particles as one set, some of which will be redrawn. */
void hypotheses_drop(gait_tracker *t);

/* Whether the odds decide between the two hypotheses; drop the less probable one. */
bool hypotheses_decided(const gait_tracker *t);
void hypotheses_merge(gait_tracker *t);

/* Record whether the hypotheses of a start with known phases agree in this frame, which ends acquisition once a person is
 * proven.  weight: of the dominant hypothesis. */
void hypotheses_record_agreement(gait_tracker *t, float weight);

/* Whether acquisition has lasted long enough, or the person walks on after standing still; lay the particles out as two
 * hypotheses.  The weights must be even, as after resampling.  Clears the templates. */
bool hypotheses_acquired(const gait_tracker *t);
void hypotheses_split(gait_tracker *t);

/* Resample if the effective sample size is too small or the number of particles changes; true if so. */
bool hypotheses_resample(gait_tracker *t, uint32_t counter);

/* Multiply the weights of the particles by the tempered likelihood exp(loglik), those of two hypotheses by their
 * evidence.  dt: seconds since the last frame. */
pf_summary hypotheses_update(gait_tracker *t, float dt);

/* Share of a frame's log-likelihood that counts, `seconds` after the last frame: its errors are correlated over config
 * evidence_time. */
float hypotheses_evidence_share(const gait_tracker *t, float seconds);

/* Left and right are not yet known. */
bool hypotheses_open(const gait_tracker *t);

/* Too early to report anything. */
bool hypotheses_acquiring(const gait_tracker *t);

/* Seconds since phase, left and right have been known, 0 before: from then on stature settles. */
float hypotheses_settled_time(const gait_tracker *t);
#endif
