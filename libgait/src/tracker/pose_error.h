/* pose_error.h - where a camera whose pose is uncertain was pointed: a shift of the image, the same for every particle.
 *
 * At a person's distance an error of the direction, or of the place across it, moves the body in the image and hardly
 * turns or scales it.  Left to the particles, such an error would be taken for motion of the person.  The likelihood
 * step then looks at every particle as if its own most probable error moved it to where the person appears, and counts
 * how probable that error is. */
#ifndef GAIT_TRACKER_POSE_ERROR_H
#define GAIT_TRACKER_POSE_ERROR_H
#include "tracker/tracker_state.h"

/* Before the likelihood step: find where the person appears by each camera, move its principal point by the shift, and set
 * aim and shift_sd; not if the standard deviations of its pose are 0. */
void pose_error_correct(gait_tracker *t);

/* Variance that the poses add to each coordinate of a place in the world, of the camera that knows it best; square
 * metres. */
double pose_error_variance(const gait_tracker *t, const float at[3]);
#endif
