/* Surface points of the limbs: where a camera sees them, and what the frame shows there. */
#include "image/camera.h"
#include "base/dispatch.h"
#include "base/fmath.h"
#include "base/simd16.h"
#include "likelihood/term.h"
#include "likelihood/simd_points.h"
#include "likelihood/visible.h"
#include <string.h>

/* ---- a block of bodies before a camera: one lane a body ---- */

/* Of the directions 0 .. 7 and their opposites 8 .. 15, those on one side of a plane through the limb are
 * consecutive: `count` of the first eight are on that side, and `last` is 1 if direction 7 is. */
static inline int32_t first_direction(int32_t count, int32_t last)
{
    return (LIKE_AZIMUTHS + (last ? -count : count)) & (LIKE_DIRECTIONS - 1);
}

/* A normal is perpendicular to the limb's axis, so the direction from which the camera views the axis
 * decides: a normal that points away from the camera on the axis also does so at its point, a radius further
 * out. */
static void choose_half(const like_surface *s, body_lanes *restrict w, const float *scale,
                        int32_t *restrict turn)
{
    float const grazing = 0.2f; /* |n.v| below which a point is too close to the outline */
    body_lanes m[3];            /* from the camera to the limb's middle, in the limb's frame, statures */
    int32_t count[BLOCK] = {0}, last[BLOCK];
    for (int32_t k = 0; k < 3; k++)
        for (int32_t i = 0; i < BLOCK; i++) {
            float const stature = 1.0f / scale[i];
            w[LIKE_VIEW_ORIGIN + k][i] *= stature;
            m[k][i] = w[LIKE_VIEW_ORIGIN + k][i] + s->middle[k];
        }
    for (int32_t d = 0; d < LIKE_AZIMUTHS; d++)
        for (int32_t i = 0; i < BLOCK; i++) {
            last[i] = s->side[0][d] * m[0][i] + s->side[1][d] * m[1][i] + s->side[2][d] * m[2][i] < 0.0f;
            count[i] += last[i];
        }
    for (int32_t i = 0; i < BLOCK; i++) {
        turn[i] = first_direction(count[i], last[i]);
        w[LIKE_VIEW_GRAZE][i] =
            -grazing * __builtin_sqrtf(m[0][i] * m[0][i] + m[1][i] * m[1][i] + m[2][i] * m[2][i]);
    }
}

/* A limb's frame and its origin in camera axes. */
static void to_camera(const gait_camera *cam, const body_lanes *R, const body_lanes *o,
                      body_lanes *restrict turn, body_lanes *restrict place)
{
    for (int32_t r = 0; r < 3; r++) {
        const float *const c = cam->R + 3 * r;
        for (int32_t k = 0; k < 3; k++)
            for (int32_t i = 0; i < BLOCK; i++)
                turn[3 * r + k][i] = c[0] * R[k][i] + c[1] * R[3 + k][i] + c[2] * R[6 + k][i];
        for (int32_t i = 0; i < BLOCK; i++)
            place[r][i] = c[0] * o[0][i] + c[1] * o[1][i] + c[2] * o[2][i] + cam->t[r];
    }
}

/* Camera coordinates (a row, x or y, and depth) to 1/256 working pixels times depth. */
static void to_image(float focus, float middle, const float *row, const float *depth, float *restrict out)
{
    for (int32_t i = 0; i < BLOCK; i++)
        out[i] = focus * row[i] + middle * depth[i];
}

void KERNEL(surface_pose)(const like_setup *s, const gait_camera *cam, const view_map *map,
                          const kin_body *body, like_pose *restrict out)
{
    float const unit = (float)LIKE_SUBPIXELS * map->scale;
    float const focus[2] = {unit * cam->fx, unit * cam->fy};
    float const middle[2] = {unit * (cam->cx - map->u0), unit * (cam->cy - map->v0)};
    for (int32_t l = 0; l < s->limbs; l++) {
        int32_t const f = s->geometry[l].frame;
        const float *const scale = body->scale[f];
        body_lanes R[9], t[3], w[LIKE_WORDS];
        to_camera(cam, body->R[f], body->o[f], R, t);
        for (int32_t k = 0; k < 3; k++) {
            for (int32_t i = 0; i < BLOCK; i++) {
                w[LIKE_VIEW_ORIGIN + k][i] =
                    R[k][i] * t[0][i] + R[3 + k][i] * t[1][i] + R[6 + k][i] * t[2][i];
                R[k][i] *= scale[i];
                R[3 + k][i] *= scale[i];
                R[6 + k][i] *= scale[i];
            }
            memcpy(w[LIKE_VIEW_IMAGE + 6 + k], R[6 + k], sizeof R[k]);
            for (int32_t r = 0; r < 2; r++)
                to_image(focus[r], middle[r], R[3 * r + k], R[6 + k], w[LIKE_VIEW_IMAGE + 3 * r + k]);
        }
        memcpy(w[LIKE_VIEW_SHIFT + 2], t[2], sizeof t[2]);
        for (int32_t r = 0; r < 2; r++)
            to_image(focus[r], middle[r], t[r], t[2], w[LIKE_VIEW_SHIFT + r]);
        choose_half(&s->surface[l], w, scale, out->limb[l].turn);
        simd16_transpose((const body_lanes *)w, out->limb[l].view);
    }
}

/* ---- the points of one body ---- */

#ifdef SIMD4
/* Project the points of half a limb, to 1/256 working pixels: shown are those that face the camera well enough and are in
 * the image. */
static inline simd16_bytes place(const like_surface *s, int32_t first, const float *view, simd4_i u[4],
                                 simd4_i v[4])
{
    float const end = (float)((VIEW_SIZE - 1) * LIKE_SUBPIXELS); /* one pixel further has no neighbours */
    enum { X = LIKE_VIEW_IMAGE, Y = X + 3, Z = Y + 3, S = LIKE_VIEW_SHIFT, E = LIKE_VIEW_ORIGIN };
    simd4_f const near = simd4_all(CAMERA_NEAR), graze = simd4_all(view[LIKE_VIEW_GRAZE]);
    simd4_u const bound = {m_bits(end), m_bits(end), m_bits(end), m_bits(end)};
    SIMD4_NUMBERS(w, view);
    simd4_i shown[4];
#pragma GCC unroll SIMD4_UNROLL
    for (int32_t i = 0; i < 4; i++) {
        int32_t const j = first + 4 * i;
        simd4_f const px = simd4_load(s->point[0] + j), py = simd4_load(s->point[1] + j),
                      pz = simd4_load(s->point[2] + j);
        simd4_f const z = SIMD4_TIMES(w, Z, px) + SIMD4_TIMES(w, Z + 1, py) + SIMD4_TIMES(w, Z + 2, pz) +
                          SIMD4_NUMBER(w, S + 2);
        simd4_f const inv = simd4_all(1.0f) / simd4_max(z, near);
        simd4_f const x = (SIMD4_TIMES(w, X, px) + SIMD4_TIMES(w, X + 1, py) + SIMD4_TIMES(w, X + 2, pz) +
                           SIMD4_NUMBER(w, S)) *
                          inv;
        simd4_f const y = (SIMD4_TIMES(w, Y, px) + SIMD4_TIMES(w, Y + 1, py) + SIMD4_TIMES(w, Y + 2, pz) +
                           SIMD4_NUMBER(w, S + 1)) *
                          inv;
        simd4_f const away = SIMD4_TIMES(w, E, simd4_load(s->normal[0] + j)) +
                             SIMD4_TIMES(w, E + 1, simd4_load(s->normal[1] + j)) +
                             SIMD4_TIMES(w, E + 2, simd4_load(s->normal[2] + j)) + simd4_load(s->outward + j);
        /* Non-negative floats are ordered like their bits; the bits of negative ones are greater. */
        shown[i] = (away < graze) & (simd4_i)(simd4_greater((simd4_u)x, (simd4_u)y) < bound);
        u[i] = simd4_whole(x);
        v[i] = simd4_whole(y);
    }
    return simd16_conditions(shown);
}

void KERNEL(surface_sample)(const like_setup *s, const features *f, const like_pose *pose, int32_t lane,
                            const layers *drawn, like_patch *restrict out)
{
    struct {
        simd16_bytes x, y, fx, fy;
    } at[MODEL_MAX_LIMBS]; /* working pixels, with fractions */
    simd16_cells cell[MODEL_MAX_LIMBS];
    uint32_t four[MODEL_MAX_LIMBS][SIMD16];
    for (int32_t l = 0; l < s->limbs; l++) {
        const grid_mask *const mask = &drawn->visible[l];
        int32_t const turn = pose->limb[l].turn[lane];
        simd4_i u[4], v[4];
        cell[l].on = place(&s->surface[l], 2 * turn, pose->limb[l].view[lane], u, v);
        simd16_split(u, &at[l].x, &at[l].fx);
        simd16_split(v, &at[l].y, &at[l].fy);
        cell[l].row = (at[l].y >> 1) - simd16_all(mask->first);
        cell[l].column = (at[l].x >> 1) - simd16_all(mask->column);
        out[l].turn = (uint8_t)turn;
    }
    simd16_covered(drawn->visible, s->limbs, cell);
    for (int32_t l = 0; l < s->limbs; l++)
        simd16_words_at(f->pairs, 2, at[l].y & cell[l].on, at[l].x & cell[l].on, four[l]);
    for (int32_t l = 0; l < s->limbs; l++) {
        simd16_bytes const on = cell[l].on, value = simd16_between(four[l], at[l].fx, at[l].fy);
        simd16_bytes const sample = (value & on) | (simd16_all(TEXTURE_HIDDEN) & ~on);
        memcpy(out[l].value, &sample, sizeof sample);
    }
}
#else
typedef struct spots { /* the points of half of each limb */
    int32_t u[MODEL_MAX_LIMBS][LIKE_HALF],
        v[MODEL_MAX_LIMBS][LIKE_HALF];      /* 1/256 working pixels, 0 where not shown */
    int32_t at[MODEL_MAX_LIMBS][LIKE_HALF]; /* index into the surface map */
    int32_t shown[MODEL_MAX_LIMBS]
                 [LIKE_HALF]; /* negative: faces the camera well enough and is in the image */
} spots;

static inline uint32_t u_max(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

/* Project the points of half a limb. Values that are read repeatedly stay in registers. */
static inline void place(const like_surface *s, const like_pose_limb *pose, int32_t lane, int32_t l,
                         spots *restrict out)
{
    float const end = (float)((VIEW_SIZE - 1) * LIKE_SUBPIXELS); /* one pixel further has no neighbours */
    int32_t const first = 2 * pose->turn[lane];
    const float *const w = pose->view[lane];
    const float *const X = w + LIKE_VIEW_IMAGE, *const Y = X + 3, *const Z = Y + 3,
                       *const E = w + LIKE_VIEW_ORIGIN;
    float const X0 = X[0], X1 = X[1], X2 = X[2], Y0 = Y[0], Y1 = Y[1], Y2 = Y[2], Z0 = Z[0], Z1 = Z[1],
                Z2 = Z[2];
    float const E0 = E[0], E1 = E[1], E2 = E[2], S0 = w[LIKE_VIEW_SHIFT], S1 = w[LIKE_VIEW_SHIFT + 1],
                S2 = w[LIKE_VIEW_SHIFT + 2];
    float const graze = w[LIKE_VIEW_GRAZE], near = f_bound(CAMERA_NEAR), one = f_bound(1.0f);
    SIMD16_LOADED(px, s->point[0] + first);
    SIMD16_LOADED(py, s->point[1] + first);
    SIMD16_LOADED(pz, s->point[2] + first);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_HALF; i++) {
        int32_t const j = first + i;
        float const nx = s->normal[0][j], ny = s->normal[1][j], nz = s->normal[2][j];
        float const z = f_max(Z0 * px[i] + Z1 * py[i] + Z2 * pz[i] + S2, near), inv = one / z;
        float const x = (X0 * px[i] + X1 * py[i] + X2 * pz[i] + S0) * inv;
        float const y = (Y0 * px[i] + Y1 * py[i] + Y2 * pz[i] + S1) * inv;
        float const away = nx * E0 + ny * E1 + nz * E2 + s->outward[j];
        /* Non-negative floats are ordered like their bits; the bits of negative ones are greater. */
        int32_t const shown = -((away < graze) & (u_max(m_bits(x), m_bits(y)) < m_bits(end)));
        out->shown[l][i] = shown;
        int32_t const u = shown ? (int32_t)x : 0, v = shown ? (int32_t)y : 0;
        out->u[l][i] = u;
        out->v[l][i] = v;
#ifndef SIMD16_BILINEAR_BYTES
        out->at[l][i] = (v & ~(LIKE_SUBPIXELS - 1)) | u >> 8;
#endif
    }
}

/* Read the surface map by bilinear interpolation, rounded towards 0. */
static inline void read_surface(const features *f, const spots *p, int32_t limbs, like_patch *restrict out)
{
#ifdef SIMD16_BILINEAR_BYTES
    for (int32_t l = 0; l < limbs; l++)
        simd16_bilinear_bytes(f->pairs, p->u[l], p->v[l], p->shown[l], TEXTURE_HIDDEN, out[l].value);
#else
    int32_t quad[MODEL_MAX_LIMBS][LIKE_HALF];
    simd16_read(2, f->pairs, p->at[0], p->shown[0], limbs * LIKE_HALF, quad[0]);
    for (int32_t l = 0; l < limbs; l++)
        simd16_bilinear_narrow(quad[l], p->u[l], p->v[l], p->shown[l], TEXTURE_HIDDEN, out[l].value);
#endif
}

/* Each step runs over all limbs before the next one begins, so that the waits of one limb are filled with
 * work on another. */
void KERNEL(surface_sample)(const like_setup *s, const features *f, const like_pose *pose, int32_t lane,
                            const layers *drawn, like_patch *restrict out)
{
    spots p;
    for (int32_t l = 0; l < s->limbs; l++) {
        place(&s->surface[l], &pose->limb[l], lane, l, &p);
        out[l].turn = (uint8_t)pose->limb[l].turn[lane];
    }
    hide(drawn->visible, s->limbs, (const int32_t (*)[SIMD16])p.u, (const int32_t (*)[SIMD16])p.v,
         LIKE_CELL_BITS, p.shown);
    read_surface(f, &p, s->limbs, out);
}
#endif
