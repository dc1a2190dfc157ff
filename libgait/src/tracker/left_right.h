/* left_right.h - check that the keypoints show the left leg where the estimate has it.
 *
 * A person seen from the side and their mirror image half a stride later have the same outline, so images hardly
 * distinguish them.  A detector that swaps the sides now and then is weaker evidence than it seems: if many of its frames
 * fit the mirror image better, left and right are open. */
#ifndef GAIT_TRACKER_LEFT_RIGHT_H
#define GAIT_TRACKER_LEFT_RIGHT_H
#include "tracker/tracker_state.h"

/* The running margin of left and right after this frame: negative if more than a quarter of the keypoints' recent
 * evidence is for the mirror image.  restart: the person has just been found; of: the class of the estimate.  A person
 * who stands still has no left and right that could be swapped. */
float left_right_update(gait_tracker *t, bool restart, const state_layout *of, const particle_state *mean);
#endif
