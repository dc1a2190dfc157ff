/* Brightness constancy along each particle's own history (Ormoneit et al. 2000, eqs. 10-13). */
#include "like.h"

static float log_likelihood(const like_body *b)
{
    float log[MODEL_MAX_LIMBS], sum = 0.0f;
    if (!b->ancestor)
        return 0.0f;
    b->setup->run->texture_logs(b, log);
    for (int32_t l = 0; l < b->setup->limbs; l++)
        sum += log[l];
    return sum;
}

/* With nobody there every limb is as good as occluded.  Only the paper's mode asks: its other evidence is
 * none, while a motionless background predicts itself too well to speak against silhouette and edges. */
static float support(const like_body *b)
{
    if (!b->setup->paper || !b->ancestor)
        return 0.0f;
    return log_likelihood(b) - (float)b->setup->limbs * LIKE_PAPER_OCCLUDED;
}

const like_term like_texture = {"texture", GAIT_TERM_TEXTURE, log_likelihood, support};
