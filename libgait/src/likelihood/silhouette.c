/* The silhouette term, in both directions: background inside the body and foreground that the body does not
 * explain. */
#include "likelihood/term.h"

/* Area of a standing person who is VIEW_PERSON / 2 cells tall, about 0.16 height^2: the same for every
 * particle. */
static const float TYPICAL = 0.16f * 0.25f * (float)VIEW_PERSON * (float)VIEW_PERSON * (float)FOREGROUND_ONE;

void like_silhouette_count(like_body *b)
{
    if (b->features->has_foreground && (b->setup->terms & GAIT_TERM_SILHOUETTE))
        b->setup->run->silhouette_count(b->features, &b->layers->whole, &b->area, &b->covered);
}

static float log_likelihood(const like_body *b)
{
    if (!b->features->has_foreground)
        return 0.0f;
    float const missed = (float)(b->features->foreground_total - b->covered);
    return -((float)(b->area - b->covered) + b->setup->missed_weight * missed) / TYPICAL;
}

/* Without a person all foreground is missed and no background is inside the body. */
static float support(const like_body *b)
{
    if (!b->features->has_foreground)
        return 0.0f;
    return (b->setup->missed_weight * (float)b->covered - (float)(b->area - b->covered)) / TYPICAL;
}

like_parts like_silhouette_parts(const like_body *b)
{
    if (!b->features->has_foreground || !(b->setup->terms & GAIT_TERM_SILHOUETTE))
        return (like_parts){0};
    float const nats = b->setup->weight[LIKE_SILHOUETTE] * b->setup->missed_weight / TYPICAL;
    return (like_parts){nats * (float)b->covered, nats * (float)(b->features->foreground_total - b->covered)};
}

const like_term like_silhouette = {"silhouette", GAIT_TERM_SILHOUETTE, log_likelihood, support};
