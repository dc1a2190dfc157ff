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

const like_term like_texture = {GAIT_TERM_TEXTURE, log_likelihood, NULL};
