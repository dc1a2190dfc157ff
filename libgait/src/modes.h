/* modes.h - left and right: two hypotheses half a stride apart, kept alive until the image decides.
 *
 * A mixture of two particle filters (Vermaak, Doucet and Perez 2003).  Each side owns half of the
 * particles; within a side they are weighed and resampled as ever, so chance cannot end a side.  The
 * sides' weights are moved by their evidence alone, from even odds.  An estimate takes all particles: a
 * particle's weight is its side's times its own.
 *
 * The odds leave the silhouette out: the two outlines differ by errors of the body's shape more than by
 * the side that is in front, and such an error does not average out.  Frames nearer together than
 * config evidence_time count less, here as in the particles' weights, because their errors are the same. */
#ifndef GAIT_MODES_H
#define GAIT_MODES_H
#include "tracker.h"

/* After a start that leaves the phase open the filter first looks for the phase modulo half a stride. */
void modes_search(gait_tracker *t);

/* Lost: both sides are one search again. */
void modes_give_up(gait_tracker *t);

/* One side is known: nothing to decide. */
void modes_single(gait_tracker *t);

/* Resample what has become too uneven; true if anything was. */
bool modes_resample(gait_tracker *t, uint32_t frame);

/* After the prediction: lay the particles out as two sides if the search is over. */
void modes_fork(gait_tracker *t);

/* Multiply the weights by the likelihood t->used, tempered, the sides' by their evidence over dt seconds. */
pf_summary modes_reweigh(gait_tracker *t, float dt);

/* Whether left and right are still open. */
bool modes_open(const gait_tracker *t);

/* Seconds since phase, left and right have been known: from then on stature settles. */
float modes_settled(const gait_tracker *t);

/* Too early to tell anything. */
bool modes_searching(const gait_tracker *t);
#endif
