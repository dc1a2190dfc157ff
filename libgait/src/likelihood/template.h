/* template.h - running appearance of each limb: what its surface points have looked like. */
#ifndef GAIT_LIKELIHOOD_TEMPLATE_H
#define GAIT_LIKELIHOOD_TEMPLATE_H
#include "likelihood/term.h"

enum { TEMPLATE_ONE = 64, TEMPLATE_EMPTY = INT16_MIN }; /* steps per unit of the surface map */

/* A template has LIKE_SAMPLES entries a limb, numbered as the surface points. */
void template_clear(int16_t *template, int32_t limbs);

/* Move every point seen in this frame a tenth of the way to what was seen. */
void template_update(int16_t *template, int32_t limbs, const like_patch *patch);

/* The template as bodies are compared with it: limbs x LIKE_RING values, TEXTURE_HIDDEN where it knows
 * nothing. */
void template_ring(const int16_t *template, int32_t limbs, int8_t *ring);
#endif
