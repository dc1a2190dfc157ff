/* The edge term: image gradient along the visible outlines of the limbs, normal to them. */
#include "likelihood/term.h"

enum { FEWEST_POINTS = 16 }; /* fewest points of an outline that count as visible */

static like_edge_tally count(const like_body *b)
{
    like_edge_tally t;
    b->setup->run->edges_count(b, &t);
    return t;
}

/* The response of so many points if an edge of full strength runs along the outline at each. */
static float most(int32_t points)
{
    return (float)(points * 2 * 64 * EDGE_ONE);
}

static float log_likelihood(const like_body *b)
{
    like_edge_tally const t = count(b);
    return t.points < FEWEST_POINTS ? -1.0f : (float)t.response / most(t.points) - 1.0f;
}

/* Log likelihood ratio against an empty scene, where the outline meets edges of any direction.  The response must exceed
 * that by 10 % and, where the image has no edges at all, by a minimum. */
static float support(const like_body *b)
{
    float const least = 0.005f;
    like_edge_tally const t = count(b);
    return t.points < FEWEST_POINTS ? -1.0f
                                    : ((float)t.response - 1.1f * (float)t.chance) / most(t.points) - least;
}

float like_edges_along(const like_body *b, float *chance)
{
    like_edge_tally const t = count(b);
    float const all = most(i_max(t.points, FEWEST_POINTS));
    *chance = (float)t.chance / all;
    return (float)t.response / all;
}

const like_term like_edges = {GAIT_TERM_EDGES, log_likelihood, support};
