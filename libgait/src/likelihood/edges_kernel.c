/* Points along the visible outlines of the limbs of one body, and the image gradient there. */
#include "base/dispatch.h"
#include "base/simd16.h"
#include "likelihood/term.h"
#include "likelihood/visible.h"

#include <string.h>

/* A limb has SIMD16 points: eight along each side of a cone, two along each side of an ellipsoid's octagon. */

/* Where on its side each point is. */
static const float SHARES[2][SIMD16] = {
    [LIMB_CONE] = {1 / 16.0f, 1 / 16.0f, 3 / 16.0f, 3 / 16.0f, 5 / 16.0f, 5 / 16.0f, 7 / 16.0f, 7 / 16.0f,
                   9 / 16.0f, 9 / 16.0f, 11 / 16.0f, 11 / 16.0f, 13 / 16.0f, 13 / 16.0f, 15 / 16.0f,
                   15 / 16.0f},
    [LIMB_ELLIPSOID] = {0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.75f, 0.75f, 0.75f, 0.75f,
                        0.75f, 0.75f, 0.75f, 0.75f}};

typedef struct limb_points { /* the side that each point is on */
    float x[SIMD16], y[SIMD16], dx[SIMD16], dy[SIMD16], normal[SIMD16];
} limb_points;

static inline void cone(const float *w, limb_points *restrict out)
{
    simd16_repeat(w + LIKE_SIDE_X, SIMD16, out->x);
    simd16_repeat(w + LIKE_SIDE_Y, SIMD16, out->y);
    simd16_repeat(w + LIKE_SIDE_DX, SIMD16, out->dx);
    simd16_repeat(w + LIKE_SIDE_DY, SIMD16, out->dy);
    simd16_repeat(w + LIKE_SIDE_NORMAL, SIMD16, out->normal);
}

/* The sides of the octagon, twice. */
static inline void ellipsoid(const like_sides *s, int32_t lane, limb_points *restrict out)
{
    simd16_duplicate(s->part[0][lane], out->x);
    simd16_duplicate(s->part[0][lane] + 8, out->y);
    simd16_duplicate(s->part[1][lane], out->dx);
    simd16_duplicate(s->part[1][lane] + 8, out->dy);
    simd16_duplicate(s->part[2][lane], out->normal);
}

typedef struct spots {                     /* points on the outlines of the limbs */
    int32_t cell[MODEL_MAX_LIMBS][SIMD16]; /* index into the edge map, then the edge tensor there */
    int32_t x[MODEL_MAX_LIMBS][SIMD16], y[MODEL_MAX_LIMBS][SIMD16]; /* cell a little inside */
    int32_t shown[MODEL_MAX_LIMBS][SIMD16];                         /* negative: inside the image */
    int32_t normal[MODEL_MAX_LIMBS][SIMD16];
} spots;

static inline void place(const limb_points *s, const float *share, const float inner[2], int32_t k,
                         spots *restrict out)
{
    float const outer = 0.5f * (1.0f - LIKE_INWARD); /* cells */
    float const inner_x = inner[0], inner_y = inner[1];
#pragma GCC unroll 1
    for (int32_t i = 0; i < SIMD16; i++) {
        float const x = s->x[i] + share[i] * s->dx[i], y = s->y[i] + share[i] * s->dy[i];
        int32_t const u = (int32_t)x, v = (int32_t)y;
        out->normal[k][i] = (int32_t)s->normal[i];
        int32_t const shown = -((uint32_t)(u | v) < VIEW_SIZE);
        out->cell[k][i] = (v * VIEW_SIZE + u) & shown;
        /* There the visible mask of the limb shows whether something nearer hides this point. */
        out->x[k][i] = (int32_t)(outer * x + inner_x);
        out->y[k][i] = (int32_t)(outer * y + inner_y);
        out->shown[k][i] = shown;
    }
}

/* 2 n'Tn = trace + (xx - yy) cos 2a + 2 xy sin 2a; 0 where a point is hidden. */
static like_edge_tally tally(const spots *p, int32_t limbs)
{
    simd16_sums const sum = simd16_sum_bytes(p->cell[0], p->normal[0], p->shown[0], limbs * SIMD16);
    return (like_edge_tally){sum.low * 64 + sum.dot, sum.low * 64, sum.count};
}

void KERNEL(edges_count)(const like_body *b, like_edge_tally *restrict out)
{
    int32_t const limbs = b->setup->limbs, lane = b->lane;
    spots p;
    for (int32_t l = 0; l < limbs; l++) {
        const like_sides *const o = &b->sides->limb[l];
        limb_points s;
        if (b->setup->geometry[l].shape == LIMB_ELLIPSOID) {
            ellipsoid(o, lane, &s);
            place(&s, SHARES[LIMB_ELLIPSOID], o->part[2][lane] + 8, l, &p);
        } else { /* `place` is called in both branches so that the sides stay in registers */
            cone(o->part[0][lane], &s);
            place(&s, SHARES[LIMB_CONE], o->part[0][lane] + LIKE_SIDE_INNER, l, &p);
        }
    }
    hide(b->layers->visible, limbs, (const int32_t (*)[SIMD16])p.x, (const int32_t (*)[SIMD16])p.y, 0,
         p.shown);
    simd16_lookup(b->features->edge, p.cell[0], p.shown[0], limbs * SIMD16, p.cell[0]);
    *out = tally(&p, limbs);
}
