/* The edge term: image gradient along the visible outlines of the limbs, normal to them. */
#include "likelihood/term.h"

enum { ENOUGH = 16 }; /* least points of an outline that count as visible */

static float log_likelihood(const like_body *b)
{
    like_edge_tally t;
    b->setup->run->edges_count(b, &t);
    if (t.points < ENOUGH)
        return -1.0f;
    return (float)t.response / (float)(t.points * 2 * 64 * EDGE_ONE) - 1.0f;
}

/* Log likelihood ratio against an empty scene, where the outline meets edges of any direction: 10 % more
 * than that is required, and a minimum where the image has no edges at all. */
static float support(const like_body *b)
{
    float const least = 0.005f;
    like_edge_tally t;
    b->setup->run->edges_count(b, &t);
    if (t.points < ENOUGH)
        return -1.0f;
    return ((float)t.response - 1.1f * (float)t.chance) / (float)(t.points * 2 * 64 * EDGE_ONE) - least;
}

float like_edges_along(const like_body *b, float *chance)
{
    like_edge_tally t;
    b->setup->run->edges_count(b, &t);
    float const all = (float)(i_max(t.points, ENOUGH) * 2 * 64 * EDGE_ONE);
    *chance = (float)t.chance / all;
    return (float)t.response / all;
}

const like_term like_edges = {GAIT_TERM_EDGES, log_likelihood, support};
