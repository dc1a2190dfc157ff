/* hypotheses.h - left and right: two hypotheses half a stride apart, kept alive until the image decides.
 *
 * A mixture of two particle filters (Vermaak, Doucet and Perez 2003).  Each side owns half of the
 * particles; within a side they are weighed and resampled as ever, so chance cannot end a side.  The
 * sides' weights are moved by their evidence alone, from even odds.  An estimate takes all particles: a
 * particle's weight is its side's times its own.
 *
 * The odds leave the silhouette out: the two outlines differ by errors of the body's shape more than by
 * the side that is in front, and such an error does not average out.  Frames nearer together than
 * config evidence_time count less, here as in the particles' weights, because their errors are the same. */
#ifndef GAIT_TRACKER_HYPOTHESES_H
#define GAIT_TRACKER_HYPOTHESES_H
#include "tracker/tracker.h"

/* After a start that leaves the phase open the filter first looks for the phase modulo half a stride. */
void hypotheses_acquire(gait_tracker *t);

/* Lost: both sides are one search again. */
void hypotheses_drop(gait_tracker *t);

/* One side is known: nothing to decide. */
void hypotheses_settle(gait_tracker *t);

/* Resample what has become too uneven; true if anything was. */
bool hypotheses_resample(gait_tracker *t, uint32_t frame);

/* After the prediction: lay the particles out as two sides if the search is over. */
void hypotheses_split(gait_tracker *t);

/* Multiply the weights by the likelihood t->used, tempered, the sides' by their evidence over dt seconds. */
pf_summary hypotheses_update(gait_tracker *t, float dt);

/* Whether left and right are still open. */
bool hypotheses_open(const gait_tracker *t);

/* Seconds since phase, left and right have been known: from then on stature settles. */
float hypotheses_settled_time(const gait_tracker *t);

/* Too early to tell anything. */
bool hypotheses_acquiring(const gait_tracker *t);
#endif
