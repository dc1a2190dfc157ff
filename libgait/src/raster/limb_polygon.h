/* limb_polygon.h - the polygon of one limb of one body; inline, so that a loop over bodies vectorises. */
#ifndef GAIT_RASTER_LIMB_POLYGON_H
#define GAIT_RASTER_LIMB_POLYGON_H
#include "image/camera.h"
#include "raster/outline.h"

#include <string.h>

typedef struct vec3 {
    float x, y, z;
} vec3;

typedef struct limb_projection { /* a limb, the frame it is fixed to, and the camera */
    const limb_geometry *g;
    float R[9], o[3], scale;
    const gait_camera *cam;
    const view_map *map;
} limb_projection;

static inline vec3 rotate(const float *M, float x, float y, float z)
{
    return (vec3){M[0] * x + M[1] * y + M[2] * z, M[3] * x + M[4] * y + M[5] * z,
                  M[6] * x + M[7] * y + M[8] * z};
}

/* Vector in the frame (statures) to camera axes, metres. */
static inline vec3 turn(const limb_projection *p, const float v[3])
{
    vec3 const w = rotate(p->R, p->scale * v[0], p->scale * v[1], p->scale * v[2]);
    return rotate(p->cam->R, w.x, w.y, w.z);
}

/* Point in the frame to camera coordinates. */
static inline vec3 place(const limb_projection *p, const float v[3])
{
    const float *const t = p->cam->t;
    vec3 const w = rotate(p->R, p->scale * v[0], p->scale * v[1], p->scale * v[2]);
    vec3 const c = rotate(p->cam->R, w.x + p->o[0], w.y + p->o[1], w.z + p->o[2]);
    return (vec3){c.x + t[0], c.y + t[1], c.z + t[2]};
}

typedef struct spot { /* a projected point in the working image, with the factors of the Jacobian */
    float x, y, inv_z, slope_x, slope_y;
} spot;

static inline spot project(const limb_projection *q, vec3 p)
{
    const gait_camera *const cam = q->cam;
    const view_map *const map = q->map;
    float const inv = 1.0f / f_max(p.z, CAMERA_NEAR), sx = p.x * inv, sy = p.y * inv;
    return (spot){(cam->fx * sx + cam->cx - map->u0) * map->scale,
                  (cam->fy * sy + cam->cy - map->v0) * map->scale, inv, sx, sy};
}

/* Image displacement of a small camera vector at a projected point. */
static inline void image_vector(const limb_projection *p, const spot *s, vec3 v, float out[2])
{
    float const k = s->inv_z * p->map->scale;
    out[0] = p->cam->fx * k * (v.x - s->slope_x * v.z);
    out[1] = p->cam->fy * k * (v.y - s->slope_y * v.z);
}

/* Half width of the ellipse with semi-axes a, b along the direction n (support function). */
static inline float support(const float a[2], const float b[2], float nx, float ny)
{
    float const p = nx * a[0] + ny * a[1], q = nx * b[0] + ny * b[1];
    return __builtin_sqrtf(p * p + q * q);
}

static inline void put(limb_polygon *out, int32_t k, float x, float y)
{
    out->x[k] = x;
    out->y[k] = y;
}

/* A tapered elliptic cylinder as a quadrilateral. */
static inline void cone_polygon(const limb_projection *p, limb_polygon *out)
{
    const limb_geometry *const g = p->g;
    vec3 const p0 = place(p, g->start), p1 = place(p, g->end);
    vec3 const lat = turn(p, g->lateral), sag = turn(p, g->sagittal);
    spot const s0 = project(p, p0), s1 = project(p, p1);
    float a[2], b[2];
    float const dx = s1.x - s0.x, dy = s1.y - s0.y, len = __builtin_sqrtf(dx * dx + dy * dy);
    float const ex = len > 1e-3f ? dx / len : 1.0f, ey = len > 1e-3f ? dy / len : 0.0f;
    image_vector(p, &s0, lat, a);
    image_vector(p, &s0, sag, b);
    float const a0[2] = {a[0] * g->a0, a[1] * g->a0}, b0[2] = {b[0] * g->b0, b[1] * g->b0};
    image_vector(p, &s1, lat, a);
    image_vector(p, &s1, sag, b);
    float const a1[2] = {a[0] * g->a1, a[1] * g->a1}, b1[2] = {b[0] * g->b1, b[1] * g->b1};
    float const w0 = support(a0, b0, -ey, ex), w1 = support(a1, b1, -ey, ex);
    /* A foreshortened limb shows the ellipse at its end, so the quadrilateral is extended by most of it. */
    float const e0 = 0.7f * support(a0, b0, ex, ey), e1 = 0.7f * support(a1, b1, ex, ey);
    put(out, 0, s0.x - ex * e0 - ey * w0, s0.y - ey * e0 + ex * w0);
    put(out, 1, s1.x + ex * e1 - ey * w1, s1.y + ey * e1 + ex * w1);
    put(out, 2, s1.x + ex * e1 + ey * w1, s1.y + ey * e1 - ex * w1);
    put(out, 3, s0.x - ex * e0 + ey * w0, s0.y - ey * e0 - ex * w0);
    float const mx = 0.5f * (p0.x + p1.x), my = 0.5f * (p0.y + p1.y), mz = 0.5f * (p0.z + p1.z);
    float const lx = p1.x - p0.x, ly = p1.y - p0.y, lz = p1.z - p0.z;
    float const dot = lx * mx + ly * my + lz * mz;
    float const sin2 =
        dot * dot / f_max((lx * lx + ly * ly + lz * lz) * (mx * mx + my * my + mz * mz), 1e-12f);
    out->depth = f_min(p0.z, p1.z) > CAMERA_NEAR ? mz : 0.0f;
    out->cos_tilt = __builtin_sqrtf(f_max(1.0f - sin2, 0.0f));
}

/* An ellipsoid as an octagon. */
static inline void ellipsoid_polygon(const limb_projection *p, limb_polygon *out)
{
    static const float COS[8] = {1.0f,  0.70710678f,  0.0f, -0.70710678f,
                                 -1.0f, -0.70710678f, 0.0f, 0.70710678f};
    static const float SIN[8] = {0.0f, 0.70710678f,  1.0f,  0.70710678f,
                                 0.0f, -0.70710678f, -1.0f, -0.70710678f};
    const limb_geometry *const g = p->g;
    float const grow = 1.054f; /* gives the octagon the area of the ellipse */
    float middle[3], half[3], v[3][2];
    for (int32_t k = 0; k < 3; k++) {
        middle[k] = 0.5f * (g->start[k] + g->end[k]);
        half[k] = 0.5f * (g->end[k] - g->start[k]);
    }
    vec3 const c = place(p, middle);
    spot const s = project(p, c);
    image_vector(p, &s, turn(p, half), v[0]);
    image_vector(p, &s, turn(p, g->lateral), v[1]);
    image_vector(p, &s, turn(p, g->sagittal), v[2]);
    float const r[3] = {1.0f, g->a0 * g->a0, g->b0 * g->b0};
    float xx = 1e-6f, xy = 0.0f, yy = 1e-6f;
    for (int32_t k = 0; k < 3; k++) {
        xx += r[k] * v[k][0] * v[k][0];
        xy += r[k] * v[k][0] * v[k][1];
        yy += r[k] * v[k][1] * v[k][1];
    }
    float const l11 = __builtin_sqrtf(xx), l21 = xy / l11,
                l22 = __builtin_sqrtf(f_max(yy - l21 * l21, 1e-6f));
    for (int32_t k = 0; k < 8; k++)
        put(out, k, s.x + grow * l11 * COS[k], s.y + grow * (l21 * COS[k] + l22 * SIN[k]));
    out->depth = c.z > CAMERA_NEAR ? c.z : 0.0f;
    out->cos_tilt = 1.0f;
}

/* The polygon of a limb. R, o, scale: the limb's frame in the world and metres per model length. */
static inline void outline_limb(const limb_geometry *g, const float R[9], const float o[3], float scale,
                                const gait_camera *cam, const view_map *map, limb_polygon *out)
{
    limb_projection p = {.g = g, .scale = scale, .cam = cam, .map = map};
    memcpy(p.R, R, sizeof p.R);
    memcpy(p.o, o, sizeof p.o);
    if (g->shape == LIMB_ELLIPSOID)
        ellipsoid_polygon(&p, out);
    else
        cone_polygon(&p, out);
}
#endif
