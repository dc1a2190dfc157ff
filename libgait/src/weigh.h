/* weigh.h - image evidence of bodies: every particle's log-likelihood. */
#ifndef GAIT_WEIGH_H
#define GAIT_WEIGH_H
#include "tracker.h"

/* Place a task's arrays; w NULL: only count. */
void weigh_scratch_layout(arena *a, const gait_model *m, weigh_scratch *w);

/* Log-likelihoods t->ll, joints and surface samples of all particles; t->used: the nats of foreground that
 * each explains. */
void weigh_particles(gait_tracker *t);

/* Surface samples of particle i in camera c by limb, NULL if none are kept. */
like_patch *texture_of(const gait_tracker *t, int32_t i, int32_t c);

/* What the cameras say of one walker. */
typedef struct weigh_sight {
    float support;    /* how much better it explains the frame than nobody, nats */
    like_parts parts; /* if it may be hidden in part */
} weigh_sight;

/* Also takes the walker's surface samples into t->seen. */
weigh_sight weigh_walker(gait_tracker *t, const walker *w);

/* For bodies apart from the particles: outlines of those in w->body in camera c, and one of them, ready for the terms;
 * seen: where its surface samples go, or NULL. */
void weigh_outline(const gait_tracker *t, int32_t c, weigh_scratch *w);
like_body weigh_look(const gait_tracker *t, int32_t c, int32_t side, int32_t lane, weigh_scratch *w,
                     like_patch *seen);
#endif
