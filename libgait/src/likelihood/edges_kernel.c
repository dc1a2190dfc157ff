/* Points along the visible outlines of the limbs of one body, and the image gradient there. */
#include "base/dispatch.h"
#include "base/simd16.h"
#include "likelihood/term.h"
#include "likelihood/visible.h"

#include <string.h>

/* A limb has SIMD16 points: eight along each side of a cone, two along each side of an ellipsoid's octagon. */

typedef struct limb_points { /* the side that each point is on, and where on it */
    float x[SIMD16], y[SIMD16], dx[SIMD16], dy[SIMD16], normal[SIMD16], share[SIMD16];
} limb_points;

static inline void cone(const float *w, limb_points *restrict out)
{
    simd16_repeat(w + LIKE_SIDE_X, SIMD16, out->x);
    simd16_repeat(w + LIKE_SIDE_Y, SIMD16, out->y);
    simd16_repeat(w + LIKE_SIDE_DX, SIMD16, out->dx);
    simd16_repeat(w + LIKE_SIDE_DY, SIMD16, out->dy);
    simd16_repeat(w + LIKE_SIDE_NORMAL, SIMD16, out->normal);
#pragma GCC unroll 1
    for (int32_t i = 0; i < SIMD16; i++)
        out->share[i] = ((float)(i >> 1) + 0.5f) / 8.0f;
}

/* The sides of the octagon, twice. */
static inline void ellipsoid(const like_sides *s, int32_t lane, limb_points *restrict out)
{
    simd16_duplicate(s->part[0][lane], out->x);
    simd16_duplicate(s->part[0][lane] + 8, out->y);
    simd16_duplicate(s->part[1][lane], out->dx);
    simd16_duplicate(s->part[1][lane] + 8, out->dy);
    simd16_duplicate(s->part[2][lane], out->normal);
#pragma GCC unroll 1
    for (int32_t i = 0; i < SIMD16; i++)
        out->share[i] = i < 8 ? 0.25f : 0.75f;
}

typedef struct spots {                     /* points on the outlines of the limbs */
    int32_t cell[MODEL_MAX_LIMBS][SIMD16]; /* index into the edge map, then the edge tensor there */
    int32_t x[MODEL_MAX_LIMBS][SIMD16], y[MODEL_MAX_LIMBS][SIMD16]; /* cell a little inside */
    int32_t shown[MODEL_MAX_LIMBS][SIMD16];                         /* negative: inside the image */
    int32_t normal[MODEL_MAX_LIMBS][SIMD16];
} spots;

static inline void place(const limb_points *s, const float inner[2], int32_t k, spots *restrict out)
{
    float const outer = 0.5f * (1.0f - LIKE_INWARD); /* cells */
    float const inner_x = inner[0], inner_y = inner[1];
#pragma GCC unroll 1
    for (int32_t i = 0; i < SIMD16; i++) {
        float const x = s->x[i] + s->share[i] * s->dx[i], y = s->y[i] + s->share[i] * s->dy[i];
        int32_t const u = (int32_t)x, v = (int32_t)y;
        out->normal[k][i] = (int32_t)s->normal[i];
        out->cell[k][i] = v * VIEW_SIZE + u;
        /* There the visible mask of the limb shows whether something nearer hides this point. */
        out->x[k][i] = (int32_t)(outer * x + inner_x);
        out->y[k][i] = (int32_t)(outer * y + inner_y);
        out->shown[k][i] = -((uint32_t)(u | v) < VIEW_SIZE);
    }
}

/* Kept out of the lookups: the compiler would keep the sums in memory, because the lookups might read them.
 * 2 n'Tn = trace + (xx - yy) cos 2a + 2 xy sin 2a; 0 where a point is hidden. */
static like_edge_tally tally(const spots *p, int32_t limbs)
{
    const int32_t *const cell = p->cell[0], *const shown = p->shown[0];
    int32_t const n = limbs * SIMD16;
    int32_t trace = 0, points = 0;
    for (int32_t i = 0; i < n; i++) {
        trace += cell[i] & 255;
        points += (int32_t)((uint32_t)shown[i] >> 31);
    }
    return (like_edge_tally){trace * 64 + odd_bytes_dot(cell, p->normal[0], n), trace * 64, points};
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
            place(&s, o->part[2][lane] + 8, l, &p);
        } else { /* `place` is called in both branches so that the sides stay in registers */
            cone(o->part[0][lane], &s);
            place(&s, o->part[0][lane] + LIKE_SIDE_INNER, l, &p);
        }
    }
    for (int32_t l = 0; l < limbs; l++)
        hide(&b->layers->visible[l], p.x[l], p.y[l], 0, p.shown[l]);
    for (int32_t l = 0; l < limbs; l++)
        simd16_lookup(b->features->edge, p.cell[l], p.shown[l], p.cell[l]);
    *out = tally(&p, limbs);
}
