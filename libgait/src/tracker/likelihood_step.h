/* likelihood_step.h - likelihood of the images given each particle, and given any other body. */
#ifndef GAIT_TRACKER_LIKELIHOOD_STEP_H
#define GAIT_TRACKER_LIKELIHOOD_STEP_H
#include "tracker/tracker_state.h"

/* Fills loglik_raw, loglik_without_silhouette, explained, texture and, if they fit, joints for all particles. */
void likelihood_step(gait_tracker *t);

/* The joints of the block in w->points become those of particles first .. first + lanes - 1 in t->joints. */
void joints_put(const gait_tracker *t, int32_t first, int32_t lanes, const likelihood_scratch *w);

typedef struct body_evidence { /* of one body, over all cameras */
    /* Log-likelihood with the body less that of an empty scene, nats; exactly 0 if no term applies. */
    float support;
    float by_keypoints; /* part of `support` that comes from the keypoints, nats */
    like_parts parts;   /* foreground explained and missed, nats */
    float chance;       /* foreground that a body explains by chance, nats */
} body_evidence;

/* Evidence e for each of the first `n` bodies in t->work[0].body.  first: receives the surface samples of the first, cameras
 * x limbs; or NULL. */
void likelihood_of_bodies(gait_tracker *t, int32_t n, like_patch *first, body_evidence *e);

/* Evidence for one body, of the class of layout `of`.  Writes its surface samples to t->estimate_patch. */
body_evidence likelihood_of_particle(gait_tracker *t, const state_layout *of, const particle_state *p);

/* Surface samples of a body, cameras x limbs; returns the cameras that have an image, as bits. */
uint32_t likelihood_sample(gait_tracker *t, const particle_state *p, like_patch *samples);

/* Texture log-likelihood of a body whose surface samples were `then` in an earlier frame of these cameras. */
float likelihood_since(gait_tracker *t, const particle_state *p, uint32_t cameras, const like_patch *then);

/* Support of one body by the keypoints of all cameras, in units of the term's cost; 0 without keypoints. */
float likelihood_of_keypoints(gait_tracker *t, const state_layout *of, const particle_state *p);

/* Prepare the templates for comparison with this frame; likelihood_step() does so too. */
void likelihood_templates(gait_tracker *t);

/* After that: log-likelihood in camera c of the particles index[0 .. lanes), whose bodies and points are in w; changes
 * no particle. */
void likelihood_particles(gait_tracker *t, int32_t c, const int32_t *index, int32_t lanes,
                          likelihood_scratch *w, float nats[BLOCK]);

/* Project the block of bodies in w->body into camera c. */
void likelihood_outline(const gait_tracker *t, int32_t c, likelihood_scratch *w);

/* One body of the projected block, ready for the terms.  samples: receives its surface samples; or NULL. */
like_body likelihood_body(const gait_tracker *t, int32_t c, int32_t hypothesis, int32_t lane,
                          likelihood_scratch *w, like_patch *samples);
#endif
