/* Sides of the limbs of a block of bodies, for the edge term: computed one lane a body, stored body by body. */
#include "base/dispatch.h"
#include "base/simd16.h"
#include "likelihood/term.h"

typedef struct side_words { /* where the values of one side are stored */
    float *x, *y, *dx, *dy, *normal;
} side_words;

/* The side between two corners. A side behind the camera, too short or not finite is placed outside the
 * image. */
static void side(const outline_lanes *o, int32_t from, int32_t next, side_words out)
{
    float const outside = -1e4f, far = f_bound(1e6f);
    const float *const x0 = o->x[from], *const y0 = o->y[from], *const x1 = o->x[next],
                       *const y1 = o->y[next];
    KERNEL_LANES
    for (int32_t i = 0; i < BLOCK; i++) {
        float const dx = x1[i] - x0[i], dy = y1[i] - y0[i], len2 = dx * dx + dy * dy;
        int32_t const real = (o->depth[i] > 0.0f) & (len2 > 1.0f) & (len2 < far * far);
        float const turn = 64.0f / (real ? len2 : 1.0f), a = real ? dx : 0.0f, b = real ? dy : 0.0f;
        out.x[i] = real ? f_clamp(x0[i], -far, far) : outside;
        out.y[i] = real ? f_clamp(y0[i], -far, far) : outside;
        out.dx[i] = a;
        out.dy[i] = b;
        int32_t const cos2 = (int32_t)((b * b - a * a) * turn), sin2 = (int32_t)(-2.0f * a * b * turn);
        out.normal[i] = (float)(sin2 * 65536 + (cos2 & 65535));
    }
}

/* The part of the inner points that comes from the middle of the limb, cells. */
static void middle(const body_lanes *v, const int32_t corner[4], float *restrict out)
{
    float const far = f_bound(1e6f), share = 0.125f * LIKE_INWARD;
    const float *const a = v[corner[0]], *const b = v[corner[1]], *const c = v[corner[2]],
                       *const d = v[corner[3]];
    for (int32_t i = 0; i < BLOCK; i++)
        out[i] = f_clamp(share * ((a[i] + b[i]) + (c[i] + d[i])), -far, far);
}

static void prepare_cone(const outline_lanes *o, like_sides *restrict out)
{
    static const int32_t corners[4] = {0, 1, 2, 3};
    body_lanes w[LIKE_WORDS] = {{0.0f}};
    for (int32_t k = 0; k < 2; k++)
        side(o, k ? 3 : 0, k ? 2 : 1,
             (side_words){w[LIKE_SIDE_X + k], w[LIKE_SIDE_Y + k], w[LIKE_SIDE_DX + k], w[LIKE_SIDE_DY + k],
                          w[LIKE_SIDE_NORMAL + k]});
    middle(o->x, corners, w[LIKE_SIDE_INNER]);
    middle(o->y, corners, w[LIKE_SIDE_INNER + 1]);
    simd16_transpose((const body_lanes *)w, out->part[0]);
}

/* In three parts: x and y of the eight sides; dx and dy; normals and the middle. */
static void prepare_ellipsoid(const outline_lanes *o, like_sides *restrict out)
{
    static const int32_t corners[4] = {0, 2, 4, 6};
    body_lanes w[3][LIKE_WORDS] = {{{0.0f}}};
    for (int32_t k = 0; k < 8; k++)
        side(o, k, (k + 1) & 7, (side_words){w[0][k], w[0][8 + k], w[1][k], w[1][8 + k], w[2][k]});
    middle(o->x, corners, w[2][8]);
    middle(o->y, corners, w[2][9]);
    for (int32_t k = 0; k < 3; k++)
        simd16_transpose((const body_lanes *)w[k], out->part[k]);
}

void KERNEL(edges_prepare)(const outline_block *outline, const limb_geometry *limbs, int32_t count,
                           like_outline *restrict out)
{
    for (int32_t l = 0; l < count; l++)
        if (limbs[l].shape == LIMB_ELLIPSOID)
            prepare_ellipsoid(&outline->limb[l], &out->limb[l]);
        else
            prepare_cone(&outline->limb[l], &out->limb[l]);
}
