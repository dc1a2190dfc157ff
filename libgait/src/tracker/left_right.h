/* left_right.h - check that the keypoints show the left leg where the estimate has it.
 *
 * Once left and right are known, only the keypoints compare the estimate with its mirror image, half a stride later.  The
 * odds begin with those at which left and right are reported as known, and are never larger, so that old evidence does not
 * outweigh new.  A frame counts as in the odds between two hypotheses: little if the detector may have swapped the sides,
 * and less if the last frame is recent. */
#ifndef GAIT_TRACKER_LEFT_RIGHT_H
#define GAIT_TRACKER_LEFT_RIGHT_H
#include "tracker/tracker_state.h"

/* Log odds of the sides of the estimate after this frame, `dt` seconds after the last: negative if the mirror image is more
 * probable.  restart: left and right have just become known, or are open; of: the class of the estimate.  A person who
 * stands still has no left and right that could be swapped. */
float left_right_update(gait_tracker *t, bool restart, float dt, const state_layout *of,
                        const particle_state *mean);
#endif
