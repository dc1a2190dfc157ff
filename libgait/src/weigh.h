/* weigh.h - image evidence of bodies: every particle's log-likelihood. */
#ifndef GAIT_WEIGH_H
#define GAIT_WEIGH_H
#include "tracker.h"

/* Place a task's arrays; w NULL: only count. */
void weigh_scratch_layout(arena *a, const gait_model *m, weigh_scratch *w);

/* Log-likelihoods t->ll, joints and surface samples of all particles. */
void weigh_particles(gait_tracker *t);

/* Surface samples of particle i in camera c by limb, NULL if none are kept. */
like_patch *texture_of(const gait_tracker *t, int32_t i, int32_t c);

/* Surface samples of one walker into t->seen; returns how much better it explains the frame than nobody,
 * nats. */
float weigh_walker(gait_tracker *t, const walker *w);
#endif
