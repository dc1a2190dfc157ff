/* linalg.h - C interface to the dense problems that Eigen solves (fixed sizes, no heap, no exceptions). */
#ifndef GAIT_BASE_LINALG_H
#define GAIT_BASE_LINALG_H
#ifdef __cplusplus
extern "C" {
#endif

/* Chordal mean of rotations: the unit quaternion that maximises sum w (q . q_i)^2, i.e. the principal
 * eigenvector of sum_qq = sum w q_i q_i' (4x4, symmetric; component order is the caller's).
 * The sign is chosen so that the first component that is not 0 is positive. */
void la_rotation_mean(const double sum_qq[16], float q[4]);

#ifdef __cplusplus
}
#endif
#endif
