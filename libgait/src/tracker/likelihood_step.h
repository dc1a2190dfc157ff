/* likelihood_step.h - image evidence of bodies: every particle's log-likelihood. */
#ifndef GAIT_TRACKER_LIKELIHOOD_STEP_H
#define GAIT_TRACKER_LIKELIHOOD_STEP_H
#include "tracker/tracker.h"

/* Place a task's arrays; w NULL: only count. */
void likelihood_scratch_layout(arena *a, const gait_model *m, likelihood_scratch *w);

/* Log-likelihoods t->ll, joints and surface samples of all particles; t->used: the nats of foreground that
 * each explains. */
void likelihood_step(gait_tracker *t);

/* Surface samples of particle i in camera c by limb, NULL if none are kept. */
like_patch *texture_of(const gait_tracker *t, int32_t i, int32_t c);

/* What the cameras say of one walker. */
typedef struct likelihood_verdict {
    float support;    /* how much better it explains the frame than nobody, nats */
    like_parts parts; /* if it may be hidden in part */
} likelihood_verdict;

/* Also takes the walker's surface samples into t->estimate_patch. */
likelihood_verdict likelihood_of_particle(gait_tracker *t, const particle_state *w);

/* For bodies apart from the particles: outlines of those in w->body in camera c, and one of them, ready for the terms;
 * seen: where its surface samples go, or NULL. */
void likelihood_outline(const gait_tracker *t, int32_t c, likelihood_scratch *w);
like_body likelihood_body(const gait_tracker *t, int32_t c, int32_t side, int32_t lane, likelihood_scratch *w,
                     like_patch *seen);
#endif
