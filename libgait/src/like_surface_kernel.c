/* Surface points: which half of a limb can face the camera, where they are and what the frame shows there. */
#include "camera.h"
#include "kernels.h"
#include "lanes.h"
#include "like.h"
#include <string.h>

/* Of the directions 0 .. 7 and their opposites 8 .. 15, those on one side of a plane through the limb follow
 * one another: `count` of the first eight lie there, and the last of these does or does not. */
static inline int32_t first_direction(int32_t count, int32_t last)
{
    return (LIKE_AZIMUTHS + (last ? -count : count)) & (LIKE_DIRECTIONS - 1);
}

/* A normal is across the limb's axis, so what counts is the direction in which the camera sees the axis: a
 * normal that leads away from the camera there does so at its point, too, a radius further out. */
static void choose_half(const like_surface *s, float (*R)[BLOCK], float (*t)[BLOCK],
                        const float *restrict scale, int32_t *restrict turn)
{
    for (int32_t i = 0; i < BLOCK; i++) {
        float w[3]; /* from the camera to the limb's middle, in the limb's frame */
        int32_t count = 0, last = 0;
        for (int32_t k = 0; k < 3; k++)
            w[k] =
                R[k][i] * t[0][i] + R[3 + k][i] * t[1][i] + R[6 + k][i] * t[2][i] + scale[i] * s->middle[k];
        for (int32_t d = 0; d < LIKE_AZIMUTHS; d++) {
            last = s->side[0][d] * w[0] + s->side[1][d] * w[1] + s->side[2][d] * w[2] < 0.0f;
            count += last;
        }
        turn[i] = first_direction(count, last);
    }
}

void KERNEL(surface_pose)(const like_setup *s, const gait_camera *cam, const kin_body *body,
                          like_pose *restrict out)
{
    for (int32_t l = 0; l < s->limbs; l++) {
        int32_t const f = s->geometry[l].frame;
        like_pose_limb *const to = &out->limb[l];
        for (int32_t r = 0; r < 3; r++) {
            const float *const c = cam->R + 3 * r;
            for (int32_t k = 0; k < 3; k++)
                for (int32_t i = 0; i < BLOCK; i++)
                    to->R[3 * r + k][i] =
                        c[0] * body->R[f][k][i] + c[1] * body->R[f][3 + k][i] + c[2] * body->R[f][6 + k][i];
            for (int32_t i = 0; i < BLOCK; i++)
                to->t[r][i] =
                    c[0] * body->o[f][0][i] + c[1] * body->o[f][1][i] + c[2] * body->o[f][2][i] + cam->t[r];
        }
        memcpy(to->scale, body->scale[f], sizeof to->scale);
        choose_half(&s->surface[l], to->R, to->t, to->scale, to->turn);
    }
}

typedef struct spots {                      /* where the points of half a limb are */
    int32_t u[LIKE_FACING], v[LIKE_FACING]; /* 1/256 working pixels, 0 where not shown */
    int32_t shown[LIKE_FACING];             /* -1: faces the camera well enough, in the image; otherwise 0 */
} spots;

static inline void place(const like_surface *s, const like_pose_limb *pose, int32_t lane,
                         const gait_camera *cam, const view_map *map, spots *restrict out)
{
    float const min_facing = 0.2f; /* |n.v| below which a point grazes the outline */
    float const scale = pose->scale[lane];
    int32_t const first = 2 * pose->turn[lane];
    float R[9], t[3];
    for (int32_t k = 0; k < 9; k++)
        R[k] = pose->R[k][lane];
    for (int32_t k = 0; k < 3; k++)
        t[k] = pose->t[k][lane];
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++) {
        int32_t const j = first + i;
        float const px = scale * s->point[0][j], py = scale * s->point[1][j], pz = scale * s->point[2][j];
        float const nx = s->normal[0][j], ny = s->normal[1][j], nz = s->normal[2][j];
        float const x = R[0] * px + R[1] * py + R[2] * pz + t[0];
        float const y = R[3] * px + R[4] * py + R[5] * pz + t[1];
        float const z = f_max(R[6] * px + R[7] * py + R[8] * pz + t[2], CAMERA_NEAR);
        float const dot = (R[0] * nx + R[1] * ny + R[2] * nz) * x + (R[3] * nx + R[4] * ny + R[5] * nz) * y +
                          (R[6] * nx + R[7] * ny + R[8] * nz) * z;
        float const inv = 1.0f / z;
        float const wx = (cam->fx * (x * inv) + cam->cx - map->u0) * map->scale;
        float const wy = (cam->fy * (y * inv) + cam->cy - map->v0) * map->scale;
        float const front = -dot - min_facing * __builtin_sqrtf(x * x + y * y + z * z);
        int32_t const shown = -((front > 0.0f) & (wx >= 0.0f) & (wy >= 0.0f) & (wx < (float)VIEW_SIZE) &
                                (wy < (float)VIEW_SIZE));
        out->shown[i] = shown;
        out->u[i] = shown ? (int32_t)(wx * 256.0f) : 0;
        out->v[i] = shown ? (int32_t)(wy * 256.0f) : 0;
    }
}

/* Points hidden by what is nearer are not shown. */
static inline void hide(const rast_mask *mask, spots *restrict p)
{
    int32_t at[LIKE_FACING], bits[LIKE_FACING];
    /* A cell of the grid has two pixels. */
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++) {
        int32_t const x = (p->u[i] >> 9) - mask->column, y = p->v[i] >> 9;
        at[i] = rast_half(x, y);
        p->shown[i] &= -((x >= 0) & (x < mask->width) & (y >= mask->first) & (y < mask->last));
    }
    lookup(mask->word, at, p->shown, bits);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++)
        p->shown[i] = -((int32_t)((uint32_t)bits[i] >> (((p->u[i] >> 9) - mask->column) & 31)) & 1);
}

/* Bilinear look-up in the surface map, rounded towards 0. */
static inline void look_up(const features *f, const spots *p, int8_t *restrict value)
{
    enum { END = (VIEW_SIZE - 1) * 256 - 1 };
    int32_t at[LIKE_FACING], quad[LIKE_FACING], all[LIKE_FACING];
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++)
        at[i] = i_min(p->v[i], END) >> 8 << 8 | i_min(p->u[i], END) >> 8;
    lookup(f->quads, at, p->shown, quad);
#pragma GCC unroll 1
    for (int32_t i = 0; i < LIKE_FACING; i++) {
        int32_t const fx = i_min(p->u[i], END) & 255, fy = i_min(p->v[i], END) & 255;
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
void KERNEL(surface_sample)(const like_setup *s, const features *f, const gait_camera *cam,
                            const like_pose *pose, int32_t lane, const layers *drawn,
                            like_patch *restrict seen)
{
    spots p[MODEL_MAX_LIMBS];
    for (int32_t l = 0; l < s->limbs; l++)
        place(&s->surface[l], &pose->limb[l], lane, cam, &f->map, &p[l]);
    for (int32_t l = 0; l < s->limbs; l++)
        hide(&drawn->visible[l], &p[l]);
    for (int32_t l = 0; l < s->limbs; l++) {
        seen[l].turn = (uint8_t)pose->limb[l].turn[lane];
        look_up(f, &p[l], seen[l].value);
    }
}
