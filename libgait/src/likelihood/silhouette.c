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

/* Share of foreground among the cells in the image that the body does not cover. */
static float density_outside(const like_body *b)
{
    int32_t cells = 0;
    for (int32_t y = 0; y < GRID_SIZE; y++)
        for (int32_t w = 0; w < GRID_WORDS; w++)
            cells += grid_popcount(b->features->inside[y][w]);
    int32_t const outside = cells * FOREGROUND_ONE - b->area;
    return outside > 0 ? (float)(b->features->foreground_total - b->covered) / (float)outside : 0.0f;
}

/* Without a person all foreground is missed and no background is inside the body.  If most of the image is foreground, as
 * after the camera has moved, any body would explain some of it, so what it explains by chance does not count. */
static float support(const like_body *b)
{
    if (!b->features->has_foreground)
        return 0.0f;
    float const missed = b->setup->missed_weight, area = (float)b->area, density = density_outside(b);
    float const gain = missed * (float)b->covered - (float)(b->area - b->covered);
    return (gain - f_max(0.0f, (missed * density - (1.0f - density)) * area)) / TYPICAL;
}

static bool silent(const like_body *b)
{
    return !b->features->has_foreground || !(b->setup->terms & GAIT_TERM_SILHOUETTE);
}

static float nats_of_missed(const like_body *b)
{
    return b->setup->weight[LIKE_SILHOUETTE] * b->setup->missed_weight / TYPICAL;
}

float like_silhouette_chance(const like_body *b)
{
    return silent(b) ? 0.0f : nats_of_missed(b) * density_outside(b) * (float)b->area;
}

like_parts like_silhouette_parts(const like_body *b)
{
    if (silent(b))
        return (like_parts){0};
    float const nats = nats_of_missed(b);
    return (like_parts){nats * (float)b->covered, nats * (float)(b->features->foreground_total - b->covered)};
}

const like_term like_silhouette = {GAIT_TERM_SILHOUETTE, log_likelihood, support};
