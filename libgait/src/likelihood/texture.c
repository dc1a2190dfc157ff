/* The texture term: brightness constancy along each particle's own history (Ormoneit et al. 2000, eqs.
 * 10-13). */
#include "likelihood/term.h"

#include <string.h>

static float log_likelihood(const like_body *b)
{
    int32_t (*const cost)[BLOCK] = b->terms->cost;
    float log[BLOCK];
    if (!b->ancestor)
        return 0.0f;
    memset(cost, 0, sizeof b->terms->cost); /* costs of the other lanes */
    b->setup->run->texture_costs(b, cost);
    b->setup->run->texture_logs(b->setup, b->outline, (const int32_t (*)[BLOCK])cost, log);
    return log[b->lane];
}

/* Without a person every limb is as good as occluded. Only the paper's mode uses this, because it has no
 * other evidence; in the default mode a static background predicts itself too well to be compared with
 * silhouette and edges. */
static float support(const like_body *b)
{
    if (!b->setup->paper || !b->ancestor)
        return 0.0f;
    return log_likelihood(b) - (float)b->setup->limbs * LIKE_PAPER_OCCLUDED;
}

const like_term like_texture = {"texture", GAIT_TERM_TEXTURE, log_likelihood, support};
