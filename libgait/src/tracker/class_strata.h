/* class_strata.h - classes of motion: every class owns a range of the particles of each hypothesis.
 *
 * An interacting multiple model particle filter (Blom and Bloem 2007).  At a resampling, particles of class j are drawn
 * from those of all classes by weight times the probability of changing to j, or of staying in it.  Each class keeps its
 * particles whatever its probability, so sampling noise cannot end it.  The probability of a class is the weight of its
 * particles.
 *
 * With one class gait_tracker.classes is NULL, and none of this is called. */
#ifndef GAIT_TRACKER_CLASS_STRATA_H
#define GAIT_TRACKER_CLASS_STRATA_H
#include "tracker/tracker_state.h"

/* Lay out the current particles in ranges by these probabilities, with weights to match. */
void class_strata_begin(gait_tracker *t, const double *probability);

/* Whether the classes need a resampling. */
bool class_strata_due(const gait_tracker *t);

/* Resample particles begin .. end - 1, one hypothesis, into n particles from `begin` on: sets parents, weights and t->next.
 * u: common offset, as in pf_draw(). */
void class_strata_resample(gait_tracker *t, int32_t begin, int32_t end, int32_t n, uint32_t u);

/* After the particles have been divided between two hypotheses, set their strata, and weights that sum to share[h] in
 * hypothesis h. */
void class_strata_split(gait_tracker *t, const double share[2]);

/* Set t->origin, the class of each new particle's ancestor; `then`: strata of the generation before. */
void class_strata_origins(gait_tracker *t, const strata *then);

/* For particles from `first` on, all of one class, which then move by dt: those whose ancestor was of another class enter
 * this class. */
void class_strata_enter(const gait_tracker *t, uint32_t counter, float dt, int32_t first, int32_t lanes,
                        particle_block *p);

/* Lower the log-likelihoods of standing particles by the drift of standing estimates. */
void class_strata_penalise_drift(gait_tracker *t);

/* An image supports this estimate: note its class and, while it stands, its drift.  Before core.last_supported changes. */
void class_strata_support(gait_tracker *t, int32_t motion_class, const particle_state *mean);

/* Probability of each class under these weights. */
void class_strata_probability(const strata *s, const double *weight, double out[GAIT_MAX_CLASSES]);

/* The most probable class, and its heaviest particle in the hypothesis of particle *best. */
int32_t class_strata_best(const strata *s, const double *weight, int32_t *best);

/* Record the estimate of this frame; after standing still, left and right are open. */
void class_strata_report(gait_tracker *t, const particle_state *mean, gait_estimate *e);
#endif
