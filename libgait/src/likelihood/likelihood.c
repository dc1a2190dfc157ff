#include "likelihood/likelihood.h"
#include "base/fmath.h"

#include <string.h>

static const like_term *const TERMS[LIKE_TERMS] = {
    [LIKE_TEXTURE] = &like_texture,   [LIKE_SILHOUETTE] = &like_silhouette, [LIKE_EDGES] = &like_edges,
    [LIKE_TEMPLATE] = &like_template, [LIKE_KEYPOINTS] = &like_keypoints,
};

/* Point and outward normal on a ring of the surface, at this angle from the lateral axis; z runs from 0 at
 * the start of the limb to 1 at its end. */
static void surface_point(const limb_geometry *g, float z, float angle, float point[3], float normal[3])
{
    float s, c, ra = g->a0 + (g->a1 - g->a0) * z, rb = g->b0 + (g->b1 - g->b0) * z, norm = 0.0f;
    m_sincos_one(angle, &s, &c);
    if (g->shape == LIMB_ELLIPSOID) {
        float const bulge = 2.0f * z - 1.0f, shrink = __builtin_sqrtf(1.0f - bulge * bulge);
        ra = g->a0 * shrink;
        rb = g->b0 * shrink;
    }
    for (int32_t k = 0; k < 3; k++) {
        point[k] =
            g->start[k] + z * (g->end[k] - g->start[k]) + ra * c * g->lateral[k] + rb * s * g->sagittal[k];
        normal[k] = c / ra * g->lateral[k] + s / rb * g->sagittal[k];
        norm += normal[k] * normal[k];
    }
    for (int32_t k = 0; k < 3; k++)
        normal[k] /= __builtin_sqrtf(norm);
}

/* Whether a point is compared.  They are chosen so that of the LIKE_HALF points that face the camera, whichever these
 * are, `points` are compared, spread over all directions and heights. */
static bool compared(int32_t i, int32_t points)
{
    int32_t const at = i ^ (i >> 2 & 1); /* neighbouring directions take different rows */
    int32_t const order = (at & 1) << 3 | (at & 2) << 1 | (at & 4) >> 1 | (at & 8) >> 3;
    return order < points;
}

/* Points on rings at the middles of equal parts of the limb.  Those that are not compared count as facing away from every
 * camera. */
static void surface_init(const limb_geometry *g, int32_t points, like_surface *out)
{
    for (int32_t i = 0; i < LIKE_RING; i++) {
        int32_t const direction = i / 2 % LIKE_DIRECTIONS, row = (direction & 1) + 2 * (i & 1);
        float const z = ((float)row + 0.5f) / (float)LIKE_ROWS;
        float p[3], n[3];
        surface_point(g, z, TWO_PI_F * (0.5f * (float)direction) / (float)LIKE_AZIMUTHS, p, n);
        for (int32_t k = 0; k < 3; k++) {
            out->point[k][i] = p[k];
            out->normal[k][i] = n[k];
        }
        out->outward[i] = compared(i, points) ? p[0] * n[0] + p[1] * n[1] + p[2] * n[2] : INFINITY;
    }
    for (int32_t k = 0; k < 3; k++) {
        out->middle[k] = 0.5f * (g->start[k] + g->end[k]);
        for (int32_t d = 0; d < LIKE_AZIMUTHS; d++)
            out->side[k][d] = out->normal[k][2 * d] + out->normal[k][2 * d + 1];
    }
}

static void cost_set(like_costs *c, int32_t difference, int32_t cost)
{
    c->one[difference] = difference == LIKE_COST_NONE ? 0 : LIKE_COUNT_ONE + cost;
    c->low[difference] = (uint8_t)(cost & 255);
    c->high[difference] = (uint8_t)(cost >> 8);
}

/* Student-t with 4 degrees of freedom and a scale of half a local standard deviation: a squared cost loses
 * track on real clips. */
static void costs_init(like_setup *s)
{
    float const scale = 0.5f * (float)CONTRAST_UNIT;
    for (int32_t d = 0; d < LIKE_COSTS; d++) {
        float const r = (float)d / scale;
        cost_set(&s->robust, d, (int32_t)(2.5f * m_log(1.0f + r * r / 4.0f) * (float)LIKE_COST_ONE + 0.5f));
        cost_set(&s->square, d, d * d);
    }
}

static bool of_arm(const char *joint)
{
    return !strcmp(joint, "shoulder") || !strcmp(joint, "elbow") || !strcmp(joint, "wrist");
}

/* Parts and pairs of joints.  Those that have a side and are not of an arm count as legs. */
static COLD void sides_init(like_setup *s, const gait_model *m)
{
    for (int32_t p = 0; p < m->points; p++) {
        int32_t const q = model_other_side(m->point_name, m->points, p);
        s->opposite[p] = (uint8_t)q;
        s->part[p] = q == p ? LIKE_MIDDLE : of_arm(m->point_name[p] + 2) ? LIKE_ARMS : LIKE_LEGS;
    }
}

void like_setup_init(like_setup *s, const gait_model *m, const gait_tracker_config *cfg, const kernels *run)
{
    s->run = run;
    s->limbs = m->limbs;
    s->paper = cfg->mode == GAIT_MODE_PAPER;
    int32_t const points = s->paper ? cfg->limb_points : LIKE_HALF;
    s->few = points / 2;
    s->all = 0.8f * (float)points; /* some are always too close to the outline */
    s->log_occluded =
        s->paper ? m_log(cfg->occluded_density) : -1.6f; /* robust: as bad as a typical mismatch */
    s->surface_var = cfg->surface_sd * cfg->surface_sd;
    s->tilt = cfg->surface_tilt;
    s->terms = cfg->terms;
    s->missed_weight = cfg->missed_weight;
    s->weight[LIKE_TEXTURE] = cfg->texture_weight;
    s->weight[LIKE_SILHOUETTE] = cfg->silhouette_weight;
    s->weight[LIKE_EDGES] = cfg->edges_weight;
    s->weight[LIKE_TEMPLATE] = cfg->template_weight;
    s->weight[LIKE_KEYPOINTS] = cfg->keypoints_weight;
    sides_init(s, m);
    limb_geometry_init(m, cfg->girth, s->geometry);
    for (int32_t l = 0; l < m->limbs; l++)
        surface_init(&s->geometry[l], points, &s->surface[l]);
    costs_init(s);
}

void like_evaluate(const like_body *b)
{
    const like_setup *const s = b->setup;
    if ((s->terms & GAIT_TERM_TEXTURE) && b->ancestor)
        s->run->texture_costs(b, b->terms->cost);
    for (int32_t k = LIKE_TEXTURE + 1; k < LIKE_TERMS; k++) /* texture comes in like_sum() */
        b->terms->nats[k][b->lane] =
            s->terms & TERMS[k]->flag ? s->weight[k] * TERMS[k]->log_likelihood(b) : 0.0f;
}

void like_sum(const like_setup *s, const outline_block *outline, bool ancestors, like_block *terms,
              float sum[BLOCK])
{
    float log[BLOCK] = {0.0f};
    if ((s->terms & GAIT_TERM_TEXTURE) && ancestors)
        s->run->texture_logs(s, outline, (const int32_t (*)[BLOCK])terms->cost, log);
    for (int32_t i = 0; i < BLOCK; i++) {
        terms->nats[LIKE_TEXTURE][i] = s->weight[LIKE_TEXTURE] * log[i];
        sum[i] = 0.0f;
        for (int32_t k = 0; k < LIKE_TERMS; k++)
            sum[i] += terms->nats[k][i];
    }
}

float like_support(const like_body *b)
{
    float sum = 0.0f;
    for (int32_t k = 0; k < LIKE_TERMS; k++)
        if ((b->setup->terms & TERMS[k]->flag) && TERMS[k]->support)
            sum += b->setup->weight[k] * TERMS[k]->support(b);
    return sum;
}
