#include "like.h"
#include "camera.h"
#include "fmath.h"

static const like_term *const TERMS[LIKE_TERMS] = {&like_texture, &like_silhouette, &like_edges,
                                                   &like_template};

/* Points on rings at the middles of equal parts of the limb, with outward normals. */
static void surface_init(const limb_geometry *g, like_surface *out)
{
    for (int32_t r = 0; r < LIKE_ROWS; r++)
        for (int32_t a = 0; a < LIKE_AZIMUTHS; a++) {
            int32_t const i = r * LIKE_AZIMUTHS + a;
            float const z = ((float)r + 0.5f) / (float)LIKE_ROWS;
            float s, c, ra = g->a0 + (g->a1 - g->a0) * z, rb = g->b0 + (g->b1 - g->b0) * z, bulge = 0.0f;
            m_sincos(TWO_PI_F * ((float)a + 0.5f * (float)(r & 1)) / (float)LIKE_AZIMUTHS, &s, &c);
            if (g->shape == LIMB_ELLIPSOID) {
                bulge = 2.0f * z - 1.0f;
                float const shrink = __builtin_sqrtf(1.0f - bulge * bulge);
                ra = g->a0 * shrink;
                rb = g->b0 * shrink;
            }
            float n[3], norm = 0.0f;
            for (int32_t k = 0; k < 3; k++) {
                float const axis = g->end[k] - g->start[k];
                out->point[k][i] = g->start[k] + z * axis + ra * c * g->lateral[k] + rb * s * g->sagittal[k];
                n[k] = c / ra * g->lateral[k] + s / rb * g->sagittal[k];
                norm += n[k] * n[k];
            }
            for (int32_t k = 0; k < 3; k++)
                out->normal[k][i] = n[k] / __builtin_sqrtf(norm);
        }
}

/* Student-t with 4 degrees of freedom and scale half a local standard deviation (prototype.md 2.1). */
static void cost_init(int16_t *cost)
{
    float const scale = 0.5f * (float)CONTRAST_UNIT;
    for (int32_t d = 0; d < LIKE_COSTS; d++) {
        float const r = (float)d / scale;
        cost[d] = (int16_t)(2.5f * m_log(1.0f + r * r / 4.0f) * (float)LIKE_COST_ONE + 0.5f);
    }
}

void like_setup_init(like_setup *s, const gait_model *m, const gait_tracker_config *cfg)
{
    s->run = kernels_choose(cfg->cpu_mask);
    s->limbs = m->limbs;
    s->paper = cfg->mode == GAIT_MODE_PAPER;
    s->terms = cfg->terms;
    s->missed_weight = cfg->missed_weight;
    for (int32_t k = 0; k < LIKE_TERMS; k++)
        s->weight[k] = cfg->term_weight[k];
    limb_geometry_init(m, cfg->girth, s->geometry);
    for (int32_t l = 0; l < m->limbs; l++)
        surface_init(&s->geometry[l], &s->surface[l]);
    cost_init(s->cost);
}

/* Bilinear look-up in the surface map; the position is inside the image. */
static int8_t surface_at(const int8_t *map, float x, float y)
{
    int32_t const u = i_clamp((int32_t)(x * 256.0f), 0, (VIEW_SIZE - 1) * 256 - 1);
    int32_t const v = i_clamp((int32_t)(y * 256.0f), 0, (VIEW_SIZE - 1) * 256 - 1);
    const int8_t *const p = map + (v >> 8) * VIEW_SIZE + (u >> 8);
    int32_t const fx = u & 255, fy = v & 255;
    int32_t const top = p[0] * (256 - fx) + p[1] * fx,
                  low = p[VIEW_SIZE] * (256 - fx) + p[VIEW_SIZE + 1] * fx;
    return (int8_t)((top * (256 - fy) + low * fy) / 65536);
}

typedef struct sample_set {                 /* surface points of one limb in the camera */
    float x[LIKE_SAMPLES], y[LIKE_SAMPLES]; /* working pixels */
    float front[LIKE_SAMPLES];              /* > 0: faces the camera well enough */
} sample_set;

/* Rotation of frame f into the camera and position of its origin there. */
static void frame_to_camera(const kin_body *body, int32_t f, int32_t lane, const gait_camera *cam, float M[9],
                            float t[3])
{
    for (int32_t r = 0; r < 3; r++) {
        const float *const c = cam->R + 3 * r;
        for (int32_t k = 0; k < 3; k++)
            M[3 * r + k] =
                c[0] * body->R[f][k][lane] + c[1] * body->R[f][3 + k][lane] + c[2] * body->R[f][6 + k][lane];
        t[r] =
            c[0] * body->o[f][0][lane] + c[1] * body->o[f][1][lane] + c[2] * body->o[f][2][lane] + cam->t[r];
    }
}

static void place_samples(const like_surface *s, const float M[9], const float t[3], float scale,
                          const gait_camera *cam, const view_map *map, sample_set *out)
{
    float const min_facing = 0.2f; /* |n.v| below which a point grazes the outline */
    for (int32_t i = 0; i < LIKE_SAMPLES; i++) {
        float const px = scale * s->point[0][i], py = scale * s->point[1][i], pz = scale * s->point[2][i];
        float const nx = s->normal[0][i], ny = s->normal[1][i], nz = s->normal[2][i];
        float const x = M[0] * px + M[1] * py + M[2] * pz + t[0];
        float const y = M[3] * px + M[4] * py + M[5] * pz + t[1];
        float const z = f_max(M[6] * px + M[7] * py + M[8] * pz + t[2], CAMERA_NEAR);
        float const dot = (M[0] * nx + M[1] * ny + M[2] * nz) * x + (M[3] * nx + M[4] * ny + M[5] * nz) * y +
                          (M[6] * nx + M[7] * ny + M[8] * nz) * z;
        float const inv = 1.0f / z;
        out->x[i] = (cam->fx * (x * inv) + cam->cx - map->u0) * map->scale;
        out->y[i] = (cam->fy * (y * inv) + cam->cy - map->v0) * map->scale;
        out->front[i] = -dot - min_facing * __builtin_sqrtf(x * x + y * y + z * z);
    }
}

void like_sample(const like_setup *s, const features *f, const gait_camera *cam, const kin_body *body,
                 int32_t lane, const layers *drawn, int8_t *seen)
{
    for (int32_t l = 0; l < s->limbs; l++, seen += LIKE_SAMPLES) {
        const rast_mask *const mask = &drawn->visible[l];
        sample_set set;
        float M[9], t[3];
        frame_to_camera(body, s->geometry[l].frame, lane, cam, M, t);
        place_samples(&s->surface[l], M, t, body->scale[s->geometry[l].frame][lane], cam, &f->map, &set);
        for (int32_t i = 0; i < LIKE_SAMPLES; i++) {
            bool const visible = set.front[i] > 0.0f && layers_visible(mask, set.x[i], set.y[i]);
            seen[i] = visible ? surface_at(f->surface, set.x[i], set.y[i]) : TEXTURE_HIDDEN;
        }
    }
}

int32_t like_compare(const like_setup *s, const int8_t *a, const int8_t *b, int32_t *cost)
{
    int32_t both = 0, sum = 0;
    for (int32_t i = 0; i < LIKE_SAMPLES; i++) {
        int32_t const d = a[i] - b[i];
        int32_t const use = a[i] != TEXTURE_HIDDEN && b[i] != TEXTURE_HIDDEN;
        both += use;
        sum += use * s->cost[d < 0 ? -d : d];
    }
    *cost = sum;
    return both;
}

float like_one(const like_body *b, const like_term *term)
{
    for (int32_t k = 0; k < LIKE_TERMS; k++)
        if (TERMS[k] == term && (b->setup->terms & term->flag))
            return b->setup->weight[k] * term->log_likelihood(b);
    return 0.0f;
}

float like_evaluate(const like_body *b)
{
    float sum = 0.0f;
    for (int32_t k = 0; k < LIKE_TERMS; k++)
        sum += like_one(b, TERMS[k]);
    return sum;
}

float like_support(const like_body *b)
{
    float sum = 0.0f;
    for (int32_t k = 0; k < LIKE_TERMS; k++)
        if ((b->setup->terms & TERMS[k]->flag) && TERMS[k]->support)
            sum += b->setup->weight[k] * TERMS[k]->support(b);
    return sum;
}
