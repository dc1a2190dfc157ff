/* mirror.h - mirrors a body left to right: the body that has the same outline half a stride later.
 *
 * From the side a person and their mirror image half a cycle later have the same outline and differ only in
 * which limb hides which. With M the reflection at the body's plane of symmetry, the image of (phase, c) is
 * (phase + 1/2, c') with the scores c' whose curves are nearest to M of the curves, in the model's own inner
 * product. Place, heading, rate and stature stay the same. */
#ifndef GAIT_FILTER_MIRROR_H
#define GAIT_FILTER_MIRROR_H
#include "filter/particles.h"

typedef struct mirror {
    int32_t components;
    float shift[GAIT_MAX_COMPONENTS]; /* c' = shift + mix c */
    float mix[GAIT_MAX_COMPONENTS][GAIT_MAX_COMPONENTS];
    int32_t partner[MODEL_MAX_CHANNELS]; /* channel on the other side, */
    float sign[MODEL_MAX_CHANNELS];      /* and its sign in the mirror */
} mirror;

void mirror_init(mirror *x, const state_layout *r);

particle_state mirror_apply(const mirror *x, const state_layout *r, const particle_state *w);
#endif
