/* like_template.h - running appearance of each limb: what its surface points have looked like. */
#ifndef GAIT_LIKE_TEMPLATE_H
#define GAIT_LIKE_TEMPLATE_H
#include "like.h"

enum { TEMPLATE_ONE = 64, TEMPLATE_EMPTY = INT16_MIN }; /* steps per unit of the surface map */

void template_clear(int16_t *template, int32_t limbs);

/* Move every point seen in this frame a tenth of the way to what was seen. */
void template_update(int16_t *template, int32_t limbs, const int8_t *seen);
#endif
