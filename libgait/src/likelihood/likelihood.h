/* likelihood.h - log p(frames | body): the weighted sum over the terms and the cameras. */
#ifndef GAIT_LIKELIHOOD_LIKELIHOOD_H
#define GAIT_LIKELIHOOD_LIKELIHOOD_H
#include "likelihood/term.h"

void like_setup_init(like_setup *s, const gait_model *m, const gait_tracker_config *cfg, const kernels *run);

/* Evaluate the terms of one body into its block; of the texture, the costs that like_sum() needs. */
void like_evaluate(const like_body *b);

/* Finish the texture term, if the bodies have ancestors, and sum over the terms. */
void like_sum(const like_setup *s, const outline_block *outline, bool ancestors, like_block *terms,
              float sum[BLOCK]);

/* Weighted sum of the terms as a log likelihood ratio against "no person is there": positive if the frame
 * shows this body. */
float like_support(const like_body *b);
#endif
