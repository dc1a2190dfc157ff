/* Image gradient along the visible outlines of the limbs, normal to them (prototype.md 5.3). */
#include "like.h"

enum {
    SIDE_POINTS = 10,
    RIM_POINTS = 3
}; /* along each side of a cone; along each side of an ellipsoid's octagon */

typedef struct tally {
    int32_t response; /* sum of n'Tn, 128 x EDGE_ONE at most per point */
    int32_t chance;   /* the same for a normal of random direction: half the trace */
    int32_t points;
} tally;

/* n points along the side from (x0, y0) to (x1, y1); (mx, my) is inside the limb. */
static void side(const features *f, const rast_mask *mask, float x0, float y0, float x1, float y1, float mx,
                 float my, int32_t n, tally *t)
{
    float const dx = x1 - x0, dy = y1 - y0, len2 = dx * dx + dy * dy;
    if (!(len2 > 1.0f && len2 < 1e12f)) /* a point, or beyond all pictures */
        return;
    /* Double-angle form of the normal (dy, -dx): n'Tn = (trace + (xx - yy) cos 2a + 2 xy sin 2a) / 2. */
    int32_t const cos2 = (int32_t)(64.0f * (dy * dy - dx * dx) / len2);
    int32_t const sin2 = (int32_t)(64.0f * (-2.0f * dx * dy) / len2);
    for (int32_t i = 0; i < n; i++) {
        float const s = ((float)i + 0.5f) / (float)n, x = x0 + s * dx, y = y0 + s * dy;
        /* A little inside the limb its own mask tells whether something nearer hides this point. */
        float const ix = x + 0.3f * (mx - x), iy = y + 0.3f * (my - y);
        if (!layers_visible(mask, ix, iy))
            continue;
        if (!(x >= 0.0f && y >= 0.0f && x < (float)VIEW_SIZE && y < (float)VIEW_SIZE))
            continue;
        const edge_cell *const e = f->edge + ((int32_t)y * VIEW_SIZE + (int32_t)x);
        t->response += e->trace * 64 + e->xx_yy * cos2 + e->xy2 * sin2;
        t->chance += e->trace * 64;
        t->points++;
    }
}

static void cone(const like_body *b, int32_t l, tally *t)
{
    const outline_block *const o = b->outline;
    int32_t const i = b->lane;
    float x[4], y[4], mx = 0.0f, my = 0.0f;
    for (int32_t k = 0; k < 4; k++) {
        x[k] = o->x[l][k][i];
        y[k] = o->y[l][k][i];
        mx += 0.25f * x[k];
        my += 0.25f * y[k];
    }
    side(b->features, &b->layers->visible[l], x[0], y[0], x[1], y[1], mx, my, SIDE_POINTS, t);
    side(b->features, &b->layers->visible[l], x[3], y[3], x[2], y[2], mx, my, SIDE_POINTS, t);
}

static void ellipsoid(const like_body *b, int32_t l, tally *t)
{
    const outline_block *const o = b->outline;
    int32_t const i = b->lane;
    float const mx = 0.5f * (o->x[l][0][i] + o->x[l][4][i]), my = 0.5f * (o->y[l][0][i] + o->y[l][4][i]);
    for (int32_t k = 0; k < 8; k++) {
        int32_t const n = (k + 1) & 7;
        side(b->features, &b->layers->visible[l], o->x[l][k][i], o->y[l][k][i], o->x[l][n][i], o->y[l][n][i],
             mx, my, RIM_POINTS, t);
    }
}

static tally outline(const like_body *b)
{
    tally t = {0, 0, 0};
    for (int32_t l = 0; l < b->setup->limbs; l++) {
        if (!(b->outline->depth[l][b->lane] > 0.0f))
            continue;
        if (b->setup->geometry[l].shape == LIMB_ELLIPSOID)
            ellipsoid(b, l, &t);
        else
            cone(b, l, &t);
    }
    return t;
}

enum { ENOUGH = 20 }; /* points below which the outline counts as unseen */

static float log_likelihood(const like_body *b)
{
    tally const t = outline(b);
    if (t.points < ENOUGH)
        return -1.0f;
    return (float)t.response / (float)(t.points * 2 * 64 * EDGE_ONE) - 1.0f;
}

/* With nobody there the outline meets edges of any direction: a tenth more than chance is asked for, and
 * something where the picture has no edges at all. */
static float support(const like_body *b)
{
    float const least = 0.005f;
    tally const t = outline(b);
    if (t.points < ENOUGH)
        return -1.0f;
    return ((float)t.response - 1.1f * (float)t.chance) / (float)(t.points * 2 * 64 * EDGE_ONE) - least;
}

const like_term like_edges = {"edges", GAIT_TERM_EDGES, log_likelihood, support};
