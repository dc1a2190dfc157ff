/* likelihood.h - log p(frames | body): the weighted sum over the terms and the cameras. */
#ifndef GAIT_LIKELIHOOD_LIKELIHOOD_H
#define GAIT_LIKELIHOOD_LIKELIHOOD_H
#include "likelihood/term.h"

void like_setup_init(like_setup *s, const gait_model *m, const gait_tracker_config *cfg, const kernels *run);

/* One body's terms into its block's, of the texture what its block goes on with. */
void like_evaluate(const like_body *b);

/* The rest of the texture, if the bodies have ancestors, and sums over the terms. */
void like_sum(const like_setup *s, const outline_block *outline, bool ancestors, like_block *terms,
              float sum[BLOCK]);

/* Sum of the weighted terms over the hypothesis that nobody is there: positive if the frame shows this
 * body. */
float like_support(const like_body *b);
#endif
