/* template.h - the template term: a running appearance of each limb, learned from the samples of its surface
 * points. */
#ifndef GAIT_LIKELIHOOD_TEMPLATE_H
#define GAIT_LIKELIHOOD_TEMPLATE_H
#include "likelihood/term.h"

enum { TEMPLATE_ONE = 64, TEMPLATE_EMPTY = INT16_MIN }; /* steps per unit of the surface map; no sample yet */

/* A template has LIKE_SAMPLES entries per limb, numbered as the surface points. */
void template_clear(int16_t *template, int32_t limbs);

/* Move every point that is visible in this frame a tenth of the way to its sample. */
void template_update(int16_t *template, int32_t limbs, const like_patch *patch);

/* The template in the form that bodies are compared with: limbs x LIKE_RING values, TEXTURE_HIDDEN where it
 * has no sample yet. */
void template_ring(const int16_t *template, int32_t limbs, int8_t *ring);
#endif
