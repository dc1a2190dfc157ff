/* exchange.h - left for right: the body that shows the same outline half a stride later, mirrored.
 *
 * Seen from the side a walker and its mirror image half a cycle on look alike but for what hides what.
 * With M the mirror at the body's plane of symmetry, the image of (phase, c) is (phase + 1/2, c') with
 * the scores c' whose curves come nearest to M of the curves, in the model's own inner product.  Place,
 * heading, rate and stature stay. */
#ifndef GAIT_EXCHANGE_H
#define GAIT_EXCHANGE_H
#include "population.h"

typedef struct exchange {
    int32_t components;
    float shift[GAIT_MAX_COMPONENTS]; /* c' = shift + mix c */
    float mix[GAIT_MAX_COMPONENTS][GAIT_MAX_COMPONENTS];
    int32_t partner[MODEL_MAX_CHANNELS]; /* the channel on the other side, */
    float sign[MODEL_MAX_CHANNELS];      /* and its sense in the mirror */
} exchange;

void exchange_init(exchange *x, const body_rule *r);

walker exchange_apply(const exchange *x, const body_rule *r, const walker *w);
#endif
