/* Points along the visible outlines of the limbs of one body, and the image gradient there. */
#include "base/dispatch.h"
#include "base/simd16.h"
#include "likelihood/term.h"
#include "likelihood/simd_points.h"
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

#ifdef SIMD4
typedef struct limb_points { /* the side that each point is on: of points 4 i .. 4 i + 3 in [i & 1] */
    simd4_f x[2], y[2], dx[2], dy[2], normal[2];
} limb_points;

static inline void cone(const float *w, limb_points *restrict out)
{
    for (int32_t k = 0; k < 2; k++) {
        out->x[k] = simd4_twice(w + LIKE_SIDE_X);
        out->y[k] = simd4_twice(w + LIKE_SIDE_Y);
        out->dx[k] = simd4_twice(w + LIKE_SIDE_DX);
        out->dy[k] = simd4_twice(w + LIKE_SIDE_DY);
        out->normal[k] = simd4_twice(w + LIKE_SIDE_NORMAL);
    }
}

static inline void ellipsoid(const like_sides *s, int32_t lane, limb_points *restrict out)
{
    for (int32_t k = 0; k < 2; k++) {
        out->x[k] = simd4_load(s->part[0][lane] + 4 * k);
        out->y[k] = simd4_load(s->part[0][lane] + 8 + 4 * k);
        out->dx[k] = simd4_load(s->part[1][lane] + 4 * k);
        out->dy[k] = simd4_load(s->part[1][lane] + 8 + 4 * k);
        out->normal[k] = simd4_load(s->part[2][lane] + 4 * k);
    }
}

typedef struct spots { /* points on the outline of a limb */
    simd16_bytes u, v; /* working pixels */
    simd4_i normal[2];
} spots;

static inline void place(const limb_points *s, const float *share, const float inner[2],
                         const grid_mask *mask, spots *restrict out, simd16_cells *restrict inside)
{
    simd4_f const outer = simd4_all(0.5f * (1.0f - LIKE_INWARD)); /* cells */
    simd4_f const inner_x = simd4_all(inner[0]), inner_y = simd4_all(inner[1]);
    simd4_i u[4], v[4], column[4], row[4], shown[4];
#pragma GCC unroll 4
    for (int32_t i = 0; i < 4; i++) {
        simd4_f const at = simd4_load(share + 4 * i);
        simd4_f const x = s->x[i & 1] + at * s->dx[i & 1], y = s->y[i & 1] + at * s->dy[i & 1];
        u[i] = simd4_whole(x);
        v[i] = simd4_whole(y);
        shown[i] = (simd4_i)((simd4_u)(u[i] | v[i]) < (simd4_u){VIEW_SIZE, VIEW_SIZE, VIEW_SIZE, VIEW_SIZE});
        /* There the visible mask of the limb shows whether something nearer hides this point. */
        column[i] = simd4_whole(outer * x + inner_x);
        row[i] = simd4_whole(outer * y + inner_y);
    }
    out->u = simd16_low(u);
    out->v = simd16_low(v);
    for (int32_t k = 0; k < 2; k++)
        out->normal[k] = simd4_whole(s->normal[k]);
    *inside = (simd16_cells){simd16_from(row, mask->first), simd16_from(column, mask->column),
                             simd16_conditions(shown)};
}

/* 2 n'Tn = trace + (xx - yy) cos 2a + 2 xy sin 2a; 0 where a point is hidden. */
void KERNEL(edges_count)(const like_body *b, like_edge_tally *restrict out)
{
    int32_t const limbs = b->setup->limbs, lane = b->lane;
    spots p[MODEL_MAX_LIMBS];
    simd16_cells inside[MODEL_MAX_LIMBS];
    uint32_t word[MODEL_MAX_LIMBS][SIMD16];
    simd16_tally tally = simd16_tally_none();
    for (int32_t l = 0; l < limbs; l++) {
        const like_sides *const o = &b->sides->limb[l];
        int32_t const shape = b->setup->geometry[l].shape;
        bool const round = shape == LIMB_ELLIPSOID;
        limb_points s;
        if (round)
            ellipsoid(o, lane, &s);
        else
            cone(o->part[0][lane], &s);
        place(&s, SHARES[shape], round ? o->part[2][lane] + 8 : o->part[0][lane] + LIKE_SIDE_INNER,
              &b->layers->visible[l], &p[l], &inside[l]);
    }
    simd16_covered(b->layers->visible, limbs, inside);
    for (int32_t l = 0; l < limbs; l++)
        simd16_words_at(b->features->edge, 4, p[l].v & inside[l].on, p[l].u & inside[l].on, word[l]);
    for (int32_t l = 0; l < limbs; l++)
        simd16_tally_add(&tally, word[l], p[l].normal, inside[l].on);
    simd16_sums const sum = simd16_tally_sums(&tally);
    *out = (like_edge_tally){sum.low * 64 + sum.dot, sum.low * 64, sum.count};
}
#else
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
#endif
