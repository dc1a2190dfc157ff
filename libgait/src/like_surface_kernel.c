/* Surface points: which half of a limb can face the camera, where they are and what the frame shows there. */
#include "camera.h"
#include "kernels.h"
#include "lanes.h"
#include "like.h"
#include <string.h>

enum { SUBPIXELS = 256 }; /* of a working pixel, in one direction */

enum { IMAGE = 0, SHIFT = 9, EYE = 12, GRAZE = 15 }; /* words of like_pose_limb */

/* Of the directions 0 .. 7 and their opposites 8 .. 15, those on one side of a plane through the limb follow
 * one another: `count` of the first eight lie there, and the last of these does or does not. */
static inline int32_t first_direction(int32_t count, int32_t last)
{
    return (LIKE_AZIMUTHS + (last ? -count : count)) & (LIKE_DIRECTIONS - 1);
}

/* A normal is across the limb's axis, so what counts is the direction in which the camera sees the axis: a
 * normal that leads away from the camera there does so at its point, too, a radius further out. */
static void choose_half(const like_surface *s, body_lanes *restrict w, const float *scale,
                        int32_t *restrict turn)
{
    float const grazing = 0.2f; /* |n.v| below which a point grazes the outline */
    for (int32_t i = 0; i < BLOCK; i++) {
        float const stature = 1.0f / scale[i];
        float e[3], m[3]; /* from the camera to the limb's frame and to its middle, in the frame, statures */
        int32_t count = 0, last = 0;
        for (int32_t k = 0; k < 3; k++) {
            e[k] = stature * w[EYE + k][i];
            m[k] = e[k] + s->middle[k];
            w[EYE + k][i] = e[k];
        }
        for (int32_t d = 0; d < LIKE_AZIMUTHS; d++) {
            last = s->side[0][d] * m[0] + s->side[1][d] * m[1] + s->side[2][d] * m[2] < 0.0f;
            count += last;
        }
        turn[i] = first_direction(count, last);
        w[GRAZE][i] = -grazing * __builtin_sqrtf(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
    }
}

/* A limb's frame and its origin in the camera's axes. */
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

/* What takes a row of camera coordinates, x or y, and depth to 1/256 working pixels times depth. */
static void to_image(float focus, float middle, const float *row, const float *depth, float *restrict out)
{
    for (int32_t i = 0; i < BLOCK; i++)
        out[i] = focus * row[i] + middle * depth[i];
}

void KERNEL(surface_pose)(const like_setup *s, const gait_camera *cam, const view_map *map,
                          const kin_body *body, like_pose *restrict out)
{
    float const unit = (float)SUBPIXELS * map->scale;
    float const focus[2] = {unit * cam->fx, unit * cam->fy};
    float const middle[2] = {unit * (cam->cx - map->u0), unit * (cam->cy - map->v0)};
    for (int32_t l = 0; l < s->limbs; l++) {
        int32_t const f = s->geometry[l].frame;
        const float *const scale = body->scale[f];
        body_lanes R[9], t[3], w[LIKE_WORDS];
        to_camera(cam, body->R[f], body->o[f], R, t);
        for (int32_t k = 0; k < 3; k++) {
            for (int32_t i = 0; i < BLOCK; i++) {
                w[EYE + k][i] = R[k][i] * t[0][i] + R[3 + k][i] * t[1][i] + R[6 + k][i] * t[2][i];
                R[k][i] *= scale[i];
                R[3 + k][i] *= scale[i];
                R[6 + k][i] *= scale[i];
            }
            memcpy(w[IMAGE + 6 + k], R[6 + k], sizeof R[k]);
            for (int32_t r = 0; r < 2; r++)
                to_image(focus[r], middle[r], R[3 * r + k], R[6 + k], w[IMAGE + 3 * r + k]);
        }
        memcpy(w[SHIFT + 2], t[2], sizeof t[2]);
        for (int32_t r = 0; r < 2; r++)
            to_image(focus[r], middle[r], t[r], t[2], w[SHIFT + r]);
        choose_half(&s->surface[l], w, scale, out->limb[l].turn);
        deal((const body_lanes *)w, out->limb[l].view);
    }
}

typedef struct spots {                      /* where the points of half a limb are */
    int32_t u[LIKE_FACING], v[LIKE_FACING]; /* 1/256 working pixels, 0 where not shown */
    int32_t shown[LIKE_FACING];             /* -1: faces the camera well enough, in the image; otherwise 0 */
} spots;

static inline void place(const like_surface *s, const like_pose_limb *pose, int32_t lane, spots *restrict out)
{
    float const end = (float)((VIEW_SIZE - 1) * SUBPIXELS); /* a pixel more has no neighbours */
    int32_t const first = 2 * pose->turn[lane];
    const float *const w = pose->view[lane];
    const float *const X = w + IMAGE, *const Y = X + 3, *const Z = Y + 3, *const E = w + EYE;
    float const X0 = X[0], X1 = X[1], X2 = X[2], Y0 = Y[0], Y1 = Y[1], Y2 = Y[2], Z0 = Z[0], Z1 = Z[1],
                Z2 = Z[2];
    float const E0 = E[0], E1 = E[1], E2 = E[2], S0 = w[SHIFT], S1 = w[SHIFT + 1], S2 = w[SHIFT + 2];
    float const graze = w[GRAZE];
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++) {
        int32_t const j = first + i;
        float const px = s->point[0][j], py = s->point[1][j], pz = s->point[2][j];
        float const nx = s->normal[0][j], ny = s->normal[1][j], nz = s->normal[2][j];
        float const z = f_max(Z0 * px + Z1 * py + Z2 * pz + S2, CAMERA_NEAR), inv = 1.0f / z;
        float const x = (X0 * px + X1 * py + X2 * pz + S0) * inv;
        float const y = (Y0 * px + Y1 * py + Y2 * pz + S1) * inv;
        float const away = nx * E0 + ny * E1 + nz * E2 + s->outward[j];
        int32_t const shown = -((away < graze) & (x >= 0.0f) & (y >= 0.0f) & (x < end) & (y < end));
        out->shown[i] = shown;
        out->u[i] = shown ? (int32_t)x : 0;
        out->v[i] = shown ? (int32_t)y : 0;
    }
}

/* Points hidden by what is nearer are not shown. */
static inline void hide(const rast_mask *mask, spots *restrict p)
{
    int32_t at[LIKE_FACING], bits[LIKE_FACING];
    uint32_t const width = (uint32_t)mask->width, rows = (uint32_t)(mask->last - mask->first);
    /* A cell of the grid has two pixels. */
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++) {
        int32_t const x = (p->u[i] >> 9) - mask->column, y = p->v[i] >> 9;
        at[i] = rast_half(x, y);
        p->shown[i] &= -(((uint32_t)x < width) & ((uint32_t)(y - mask->first) < rows));
    }
    lookup(mask->word, at, p->shown, bits);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++)
        p->shown[i] = -((int32_t)((uint32_t)bits[i] >> (((p->u[i] >> 9) - mask->column) & 31)) & 1);
}

/* Bilinear look-up in the surface map, rounded towards 0. */
static inline void look_up(const features *f, const spots *p, int8_t *restrict value)
{
    int32_t at[LIKE_FACING], quad[LIKE_FACING], all[LIKE_FACING];
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++)
        at[i] = p->v[i] >> 8 << 8 | p->u[i] >> 8;
    lookup(f->quads, at, p->shown, quad);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++) {
        int32_t const fx = p->u[i] & 255, fy = p->v[i] & 255;
        uint32_t const four = (uint32_t)quad[i];
        int32_t const left_top = (int32_t)(four << 24) >> 24, right_top = (int32_t)(four << 16) >> 24;
        int32_t const left_low = (int32_t)(four << 8) >> 24, right_low = (int32_t)four >> 24;
        int32_t const top = left_top * 256 + (right_top - left_top) * fx;
        int32_t const low = left_low * 256 + (right_low - left_low) * fx;
        int32_t const grey = (top * 256 + (low - top) * fy) / 65536;
        all[i] = p->shown[i] ? grey : TEXTURE_HIDDEN;
    }
    narrow(all, value);
}

/* One step for all limbs after the other: what a limb waits for is filled with the next one's work. */
void KERNEL(surface_sample)(const like_setup *s, const features *f, const like_pose *pose, int32_t lane,
                            const layers *drawn, like_patch *restrict seen)
{
    spots p[MODEL_MAX_LIMBS];
    for (int32_t l = 0; l < s->limbs; l++)
        place(&s->surface[l], &pose->limb[l], lane, &p[l]);
    for (int32_t l = 0; l < s->limbs; l++)
        hide(&drawn->visible[l], &p[l]);
    for (int32_t l = 0; l < s->limbs; l++) {
        seen[l].turn = (uint8_t)pose->limb[l].turn[lane];
        look_up(f, &p[l], seen[l].value);
    }
}
