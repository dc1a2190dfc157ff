/* robust.h - fits that the outliers of a detector do not mislead.
 *
 * Spikes, points that are elsewhere for a frame or two, are left out before anything is known of the motion.  Points
 * that are wrong for longer, on the other leg or on another person, are down-weighted after a fit: beyond four standard
 * deviations from the prediction a point's own standard deviation grows with the square of the distance, so that its
 * influence falls with the third power.  Nearer points keep theirs.  If half of a frame's points are far away, as in a
 * motion unlike those learnt, the limit is three times their median distance. */
#ifndef GAIT_LIFT_ROBUST_H
#define GAIT_LIFT_ROBUST_H
#include "lift/fit.h"

/* Set sd (frames x points) to -1 for spikes: points far off the line through the same point's neighbours in
 * time, the furthest first.  "Far" is measured by the larger of the point's noise and the median of all its
 * distances, which includes its acceleration.  time: frames, in any unit; uv: frames x points x 2; scratch: 2
 * x frames. Returns how many points were left out. */
int32_t lift_remove_spikes(int32_t frames, int32_t points, const double *time, const double *uv, double *sd,
                           double *scratch);
/* Enlarge sd of the points of a frame that are far from their prediction.  square: squared distances divided by the
 * variance; scratch: points.  Returns how many points are outliers. */
int32_t lift_weight_points(int32_t points, const double *square, double *sd, double *scratch);
/* Standard deviations sd (J) for the points observed in a frame, by a posterior's prediction.  known: the
 * posterior already includes the points; else their distances are divided by the standard deviation of the
 * prediction too. position (J x 3) receives the predictions.  Returns how many points are outliers. */
int32_t lift_weight_frame(const lift_table *t, const segment_posterior *b, double at,
                          const lift_observations *observed, bool known, double *position, double *sd);

typedef struct lift_robust {
    double *sd;        /* frames x J: w->sd; receives the standard deviations that count */
    double *inlier_sd; /* frames x J: as observed */
    double *position;  /* J x 3, scratch */
} lift_robust;

/* Fit b to the points of a window, with outliers of the fit down-weighted; w->sd must be r->sd.  If outliers may have
 * misled the search, it is repeated with all points down-weighted at first, and the more probable fit is kept.  false:
 * numbers out of range. */
bool lift_fit_robust(const lift_table *t, lift_search *s, const lift_window *w, const lift_robust *r,
                     segment_posterior *b, lift_outcome *out, int32_t *outliers);
#endif
