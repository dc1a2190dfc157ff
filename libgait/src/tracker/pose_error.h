/* pose_error.h - where a camera whose pose is uncertain was pointed: a shift of the image, the same for every particle.
 *
 * At a person's distance an error of a camera's direction, or of its position across that direction, moves the body in the
 * image and hardly turns or scales it.  Without this the particles would take such an error for motion of the person.  For
 * every particle, the likelihood step then displaces the body to where the person appears, and takes into account how
 * probable the error of the pose is that this implies. */
#ifndef GAIT_TRACKER_POSE_ERROR_H
#define GAIT_TRACKER_POSE_ERROR_H
#include "tracker/tracker_state.h"

/* Before the likelihood step: find where the person appears by each camera, move its principal point by the shift, and set
 * aim and shift_sd; not if the standard deviations of its pose are 0. */
void pose_error_correct(gait_tracker *t);

/* Variance that errors of the poses add to each coordinate of a point in the world, by the camera for which it is
 * smallest; square metres. */
double pose_error_variance(const gait_tracker *t, const float at[3]);
#endif
