/* Surface points of one body: where they are and what the frame shows there. */
#include "image/camera.h"
#include "base/fmath.h"
#include "base/dispatch.h"
#include "base/simd16.h"
#include "likelihood/likelihood.h"
#include "likelihood/hide.h"
#include <string.h>

typedef struct spots {                      /* where the points of half a limb are */
    int32_t u[LIKE_FACING], v[LIKE_FACING]; /* 1/256 working pixels, 0 where not shown */
    int32_t shown[LIKE_FACING];             /* negative: faces the camera well enough, in the image */
} spots;

static inline uint32_t u_max(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

/* Points of half a limb; what is read again stays in registers. */
static inline void place(const like_surface *s, const like_pose_limb *pose, int32_t lane, spots *restrict out)
{
    float const end = (float)((VIEW_SIZE - 1) * LIKE_SUBPIXELS); /* a pixel more has no neighbours */
    int32_t const first = 2 * pose->turn[lane];
    const float *const w = pose->view[lane];
    const float *const X = w + LIKE_VIEW_IMAGE, *const Y = X + 3, *const Z = Y + 3,
                       *const E = w + LIKE_VIEW_EYE;
    float const X0 = X[0], X1 = X[1], X2 = X[2], Y0 = Y[0], Y1 = Y[1], Y2 = Y[2], Z0 = Z[0], Z1 = Z[1],
                Z2 = Z[2];
    float const E0 = E[0], E1 = E[1], E2 = E[2], S0 = w[LIKE_VIEW_SHIFT], S1 = w[LIKE_VIEW_SHIFT + 1],
                S2 = w[LIKE_VIEW_SHIFT + 2];
    float const graze = w[LIKE_VIEW_GRAZE];
    float px[LIKE_FACING], py[LIKE_FACING], pz[LIKE_FACING];
    simd16_once(s->point[0] + first, px);
    simd16_once(s->point[1] + first, py);
    simd16_once(s->point[2] + first, pz);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++) {
        int32_t const j = first + i;
        float const nx = s->normal[0][j], ny = s->normal[1][j], nz = s->normal[2][j];
        float const z = f_max(Z0 * px[i] + Z1 * py[i] + Z2 * pz[i] + S2, CAMERA_NEAR), inv = 1.0f / z;
        float const x = (X0 * px[i] + X1 * py[i] + X2 * pz[i] + S0) * inv;
        float const y = (Y0 * px[i] + Y1 * py[i] + Y2 * pz[i] + S1) * inv;
        float const away = nx * E0 + ny * E1 + nz * E2 + s->outward[j];
        /* Floats that are not negative are in the order of their bits; the others' are greater. */
        int32_t const shown = -((away < graze) & (u_max(m_bits(x), m_bits(y)) < m_bits(end)));
        out->shown[i] = shown;
        out->u[i] = shown ? (int32_t)x : 0;
        out->v[i] = shown ? (int32_t)y : 0;
    }
}

/* Bilinear look-up in the surface map, rounded towards 0. */
static inline void look_up(const features *f, const spots *p, int8_t *restrict value)
{
#ifdef SIMD16_BETWEEN
    simd16_between(f->pairs, p->u, p->v, p->shown, TEXTURE_HIDDEN, value);
#else
    int32_t at[LIKE_FACING], quad[LIKE_FACING], all[LIKE_FACING];
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++)
        at[i] = p->v[i] >> 8 << 8 | p->u[i] >> 8;
    simd16_lookup_every(2, f->pairs, at, p->shown, quad);
    simd16_bilinear(quad, p->u, p->v, all);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++)
        all[i] = p->shown[i] < 0 ? all[i] : TEXTURE_HIDDEN;
    simd16_narrow(all, value);
#endif
}

/* One step for all limbs after the other: what a limb waits for is filled with the next one's work. */
void KERNEL(surface_sample)(const like_setup *s, const features *f, const like_pose *pose, int32_t lane,
                            const layers *drawn, like_patch *restrict seen)
{
    spots p[MODEL_MAX_LIMBS];
    for (int32_t l = 0; l < s->limbs; l++)
        place(&s->surface[l], &pose->limb[l], lane, &p[l]);
    for (int32_t l = 0; l < s->limbs; l++)
        hide(&drawn->visible[l], p[l].u, p[l].v, LIKE_CELL_BITS, p[l].shown);
    for (int32_t l = 0; l < s->limbs; l++) {
        seen[l].turn = (uint8_t)pose->limb[l].turn[lane];
        look_up(f, &p[l], seen[l].value);
    }
}
