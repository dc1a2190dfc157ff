/* Silhouette both ways: background inside the body and foreground that the body leaves unexplained. */
#include "like.h"

/* Area of the body (in FG_ONE per cell) and the foreground under it, over cells that the camera sees. */
static void count(const like_body *b, int32_t *area, int32_t *covered)
{
    b->setup->run->silhouette_count(b->features, &b->layers->whole, area, covered);
}

/* Area of a standing person of VIEW_PERSON / 2 cells, about 0.16 height^2: the same for every particle. */
static const float TYPICAL = 0.16f * 0.25f * (float)VIEW_PERSON * (float)VIEW_PERSON * (float)FG_ONE;

static float log_likelihood(const like_body *b)
{
    int32_t area, covered;
    if (!b->features->has_fg)
        return 0.0f;
    count(b, &area, &covered);
    float const missed = (float)(b->features->fg_total - covered);
    return -((float)(area - covered) + b->setup->missed_weight * missed) / TYPICAL;
}

/* With nobody there all foreground is missed and no background is inside. */
static float support(const like_body *b)
{
    int32_t area, covered;
    if (!b->features->has_fg)
        return 0.0f;
    count(b, &area, &covered);
    return (b->setup->missed_weight * (float)covered - (float)(area - covered)) / TYPICAL;
}

const like_term like_silhouette = {"silhouette", GAIT_TERM_SILHOUETTE, log_likelihood, support};
