/* walk_check.h - paper mode: whether the picture under the body walks with it.
 *
 * Eqs. 10-13 compare a limb only with what it covered in the frame before, and a static background predicts itself better
 * than any person does, so no value of the likelihood shows that a body has slid onto the wall.  The surface that the body
 * had a fifth of a second ago does: a person's is found again where the body has walked to since, a wall's where the body
 * was. */
#ifndef GAIT_TRACKER_WALK_CHECK_H
#define GAIT_TRACKER_WALK_CHECK_H
#include "tracker/tracker_state.h"

/* After the estimate: compare this frame with that surface, if there is one of the right age. */
void walk_check_update(gait_tracker *t, const particle_state *mean);

/* False while what the body covers stays behind (config stayed_nats).  True outside paper mode. */
bool walk_check_passes(const gait_tracker *t);
#endif
