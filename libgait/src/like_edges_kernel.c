/* Points along the visible outlines of the limbs, and the image gradient there. */
#include "kernels.h"
#include "lanes.h"
#include "like.h"

#include <string.h>

/* A limb has LANES points: eight along each side of a cone, two along each side of an ellipsoid's octagon. */
typedef struct sides { /* of each point's side, from 0 to 1, and how far along it lies */
    float x0[LANES], y0[LANES], x1[LANES], y1[LANES], share[LANES];
    float middle_x, middle_y; /* inside the limb */
} sides;

static inline void cone(const outline_lanes *o, int32_t lane, sides *restrict out)
{
    float x[4], y[4], mx = 0.0f, my = 0.0f;
    for (int32_t k = 0; k < 4; k++) {
        x[k] = o->x[k][lane];
        y[k] = o->y[k][lane];
        mx += 0.25f * x[k];
        my += 0.25f * y[k];
    }
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++) {
        out->x0[i] = i < 8 ? x[0] : x[3];
        out->y0[i] = i < 8 ? y[0] : y[3];
        out->x1[i] = i < 8 ? x[1] : x[2];
        out->y1[i] = i < 8 ? y[1] : y[2];
        out->share[i] = ((float)(i & 7) + 0.5f) / 8.0f;
    }
    out->middle_x = mx;
    out->middle_y = my;
}

/* The octagon's corners from the one `ahead`, twice round: fetched, because lanes written one by one are waited for. */
static inline void corners(const float (*v)[BLOCK], int32_t lane, int32_t ahead, float *restrict out)
{
    int32_t at[LANES], all[LANES], bits[LANES];
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++) {
        at[i] = ((i + ahead) & 7) * BLOCK + lane;
        all[i] = -1;
    }
    lookup(v, at, all, bits);
    memcpy(out, bits, sizeof bits);
}

static inline void ellipsoid(const outline_lanes *o, int32_t lane, sides *restrict out)
{
    corners(o->x, lane, 0, out->x0);
    corners(o->y, lane, 0, out->y0);
    corners(o->x, lane, 1, out->x1);
    corners(o->y, lane, 1, out->y1);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++)
        out->share[i] = i < 8 ? 0.25f : 0.75f;
    out->middle_x = 0.5f * (o->x[0][lane] + o->x[4][lane]);
    out->middle_y = 0.5f * (o->y[0][lane] + o->y[4][lane]);
}

typedef struct spots {                     /* points of the limbs' outlines */
    int32_t cell[MODEL_MAX_LIMBS][LANES];  /* of the edge map; then n'Tn there, */
    int32_t word[MODEL_MAX_LIMBS][LANES];  /* of the limb's mask; then half the trace of T, */
    int32_t shown[MODEL_MAX_LIMBS][LANES]; /* -1: on a side of some length, in the image; otherwise 0 */
    int32_t bit[MODEL_MAX_LIMBS][LANES];   /* in the word */
    int32_t cos2[MODEL_MAX_LIMBS][LANES],
        sin2[MODEL_MAX_LIMBS][LANES]; /* double-angle form of the side's normal (dy, -dx), 64 = 1 */
} spots;

static inline int32_t inside(float x, float y)
{
    return (x >= 0.0f) & (y >= 0.0f) & (x < (float)VIEW_SIZE) & (y < (float)VIEW_SIZE);
}

static inline void place(const sides *s, const rast_mask *mask, int32_t k, spots *restrict out)
{
    int32_t const first = mask->first, last = mask->last, column = mask->column, width = mask->width;
    float const mx = s->middle_x, my = s->middle_y;
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++) {
        float const dx = s->x1[i] - s->x0[i], dy = s->y1[i] - s->y0[i], len2 = dx * dx + dy * dy;
        float const x = s->x0[i] + s->share[i] * dx, y = s->y0[i] + s->share[i] * dy;
        /* A little inside the limb its own mask tells whether something nearer hides this point. */
        float const ix = x + 0.3f * (mx - x), iy = y + 0.3f * (my - y);
        /* Neither a point nor beyond all pictures. */
        int32_t const real = (len2 > 1.0f) & (len2 < 1e12f) & inside(x, y) & inside(ix, iy);
        int32_t const u = real ? (int32_t)x : 0, v = real ? (int32_t)y : 0;
        int32_t const c = (real ? (int32_t)ix >> 1 : 0) - column, r = real ? (int32_t)iy >> 1 : 0;
        out->cos2[k][i] = real ? (int32_t)(64.0f * (dy * dy - dx * dx) / len2) : 0;
        out->sin2[k][i] = real ? (int32_t)(64.0f * (-2.0f * dx * dy) / len2) : 0;
        out->cell[k][i] = v * VIEW_SIZE + u;
        out->word[k][i] = rast_half(c, r);
        out->bit[k][i] = c & 31;
        out->shown[k][i] = -(real & (c >= 0) & (c < width) & (r >= first) & (r < last));
    }
}

static inline void hide(const rast_mask *mask, int32_t k, spots *restrict p)
{
    int32_t bits[LANES];
    lookup(mask->word, p->word[k], p->shown[k], bits);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++)
        p->shown[k][i] = -((int32_t)((uint32_t)bits[i] >> p->bit[k][i]) & 1);
}

/* n'Tn = (trace + (xx - yy) cos 2a + 2 xy sin 2a) / 2, doubled; nothing where nothing is shown. */
static inline void respond(const edge_cell *edge, int32_t k, spots *restrict p)
{
    int32_t cell[LANES];
    lookup(edge, p->cell[k], p->shown[k], cell);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LANES; i++) {
        uint32_t const e = (uint32_t)cell[i];
        int32_t const trace = (int32_t)(e << 24) >> 24, xx_yy = (int32_t)(e << 16) >> 24;
        int32_t const xy2 = (int32_t)(e << 8) >> 24;
        p->cell[k][i] = trace * 64 + xx_yy * p->cos2[k][i] + xy2 * p->sin2[k][i];
        p->word[k][i] = trace * 64;
    }
}

/* Apart from the look-ups, which might read the sum: it would be kept in memory. */
static inline int32_t sum(const int32_t *v, int32_t limbs)
{
    int32_t all = 0;
    for (int32_t i = 0; i < limbs * LANES; i++)
        all += v[i];
    return all;
}

void KERNEL(edges_count)(const like_body *b, like_edge_tally *restrict out)
{
    const rast_mask *mask[MODEL_MAX_LIMBS];
    spots p;
    int32_t n = 0;
    for (int32_t l = 0; l < b->setup->limbs; l++) {
        const outline_lanes *const o = &b->outline->limb[l];
        sides s;
        if (!(o->depth[b->lane] > 0.0f))
            continue;
        mask[n] = &b->layers->visible[l];
        if (b->setup->geometry[l].shape == LIMB_ELLIPSOID) {
            ellipsoid(o, b->lane, &s);
            place(&s, mask[n], n, &p);
        } else { /* twice, so that the sides need not be written down */
            cone(o, b->lane, &s);
            place(&s, mask[n], n, &p);
        }
        n++;
    }
    for (int32_t k = 0; k < n; k++)
        hide(mask[k], k, &p);
    for (int32_t k = 0; k < n; k++)
        respond(b->features->edge, k, &p);
    *out = (like_edge_tally){sum(p.cell[0], n), sum(p.word[0], n), -sum(p.shown[0], n)};
}
