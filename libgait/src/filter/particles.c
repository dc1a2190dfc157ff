#include "filter/particles.h"
#include "base/fmath.h"
#include <string.h>

float state_layout_pace(const state_layout *r, float stride_hz)
{
    return r->plain_root ? 0.0f : kin_pace(r->model, stride_hz);
}

float root_channel(const gait_model *m, int32_t c, float phase, float pace, const float *coef,
                   int32_t components)
{
    return kin_channel(m, m->root_channel + c, phase, pace, coef, components);
}

/* The stride's length is the mean of its forward speed over the phase. */
COLD float particle_speed(const state_layout *r, const particle_state *p)
{
    const gait_model *const m = r->model;
    float const pace = state_layout_pace(r, p->f[F_RATE]);
    float sum = 0.0f;
    if (m->direction == 0)
        return 0.0f;
    if (r->plain_root)
        return p->f[F_STATURE] * p->f[F_RATE] * m->stride_length;
    for (int32_t j = 0; j < m->phases; j++)
        sum += root_channel(m, ROOT_FORWARD, (float)j / (float)m->phases, pace, p->f + F_COEF,
                            r->curve_components);
    return p->f[F_STATURE] * p->f[F_RATE] * sum / (float)m->phases;
}

/* Components used by default. The first ones distinguish people in images; more only add dimensions that the
 * particles must search. */
enum { DEFAULT_COMPONENTS = 5 };

static int32_t components_used(const gait_model *m, const gait_tracker_config *cfg)
{
    if (cfg->components >= 0)
        return cfg->components;
    return cfg->mode == GAIT_MODE_PAPER || m->components < DEFAULT_COMPONENTS ? m->components
                                                                              : DEFAULT_COMPONENTS;
}

static float mean_height(const gait_model *m)
{
    float sum = 0.0f;
    for (int32_t j = 0; j < m->phases; j++)
        sum += m->curves[j * m->channels + m->root_channel + ROOT_HEIGHT] / (float)m->phases;
    return sum;
}

COLD state_layout state_layout_init(const gait_model *m, const gait_tracker_config *cfg, const kernels *run)
{
    state_layout r = {.model = m,
                      .run = run,
                      .components = components_used(m, cfg),
                      .proportions = cfg->proportions < 0 ? m->proportions : cfg->proportions,
                      .plain_root = cfg->mode == GAIT_MODE_PAPER};
    r.curve_components = r.components;
    r.mean_height = mean_height(m);
    uint32_t const offsets = cfg->offset_angles < 0 ? model_posture_angles(m) : (uint32_t)cfg->offset_angles;
    for (int32_t a = 0; a < m->angles; a++)
        if (offsets >> a & 1u)
            r.angle[r.offsets++] = a;
    return r;
}

COLD state_layout state_layout_of_class(const state_layout *first, int32_t motion_class)
{
    state_layout r = *first;
    r.model = first->model->of_class[motion_class];
    r.curve_components = i_min(r.components, r.model->components);
    r.mean_height = mean_height(r.model);
    return r;
}

particle_state particle_get(const particle_set *p, int32_t i)
{
    particle_state w = {{0}};
    for (int32_t f = 0; f < p->fields; f++)
        w.f[f] = field(p, f)[i];
    return w;
}

void particle_put(particle_set *p, int32_t i, const particle_state *w)
{
    for (int32_t f = 0; f < p->fields; f++)
        field(p, f)[i] = w->f[f];
}

void particle_block_get(const particle_set *p, const int32_t *index, int32_t lanes, particle_block *out)
{
    for (int32_t f = 0; f < p->fields; f++) {
        const float *const v = field(p, f);
        for (int32_t lane = 0; lane < BLOCK; lane++)
            out->f[f][lane] = v[index[i_min(lane, lanes - 1)]];
    }
}

void particle_block_put(particle_set *p, int32_t first, int32_t lanes, const particle_block *w)
{
    for (int32_t f = 0; f < p->fields; f++)
        block_copy(field(p, f) + first, w->f[f], lanes);
}

/* Sway to the left and height of the pelvis relative to the path, metres. */
static void pelvis_offset(const state_layout *r, const particle_state *w, float *sway, float *height)
{
    float const H = w->f[F_STATURE], phase = w->f[F_PHASE], pace = state_layout_pace(r, w->f[F_RATE]);
    *sway = r->plain_root
                ? 0.0f
                : H * root_channel(r->model, ROOT_SWAY, phase, pace, w->f + F_COEF, r->curve_components);
    *height = H * (1.0f + kin_height_change(r->model, w->f + state_layout_proportion(r), r->proportions)) *
              (r->plain_root
                   ? r->mean_height
                   : root_channel(r->model, ROOT_HEIGHT, phase, pace, w->f + F_COEF, r->curve_components));
}

COLD gait_state particle_to_state(const state_layout *r, const particle_state *w)
{
    gait_state s = {.phase = w->f[F_PHASE],
                    .stride_hz = w->f[F_RATE],
                    .stature = w->f[F_STATURE],
                    .heading = w->f[F_HEADING],
                    .pitch = w->f[F_PITCH],
                    .roll = w->f[F_ROLL],
                    .turn_rate = w->f[F_TURN],
                    .motion_class = r->model->motion_class};
    float sway, height, sn, cs;
    pelvis_offset(r, w, &sway, &height);
    m_sincos_one(s.heading, &sn, &cs);
    s.pelvis[0] = w->f[F_X] - sway * sn;
    s.pelvis[1] = w->f[F_Y] + sway * cs;
    s.pelvis[2] = w->f[F_Z] + height;
    for (int32_t k = 0; k < r->components; k++)
        s.coef[k] = w->f[F_COEF + k];
    for (int32_t k = 0; k < r->proportions; k++)
        s.proportion[k] = w->f[state_layout_proportion(r) + k];
    for (int32_t k = 0; k < r->offsets; k++)
        s.offset[r->angle[k]] = w->f[state_layout_offset(r) + k];
    return s;
}

COLD particle_state particle_from_state(const state_layout *r, const gait_state *s)
{
    particle_state w = {{0}};
    float sway, height, sn, cs;
    w.f[F_PHASE] = m_wrap1(s->phase);
    w.f[F_RATE] = s->stride_hz;
    w.f[F_STATURE] = s->stature;
    w.f[F_HEADING] = s->heading;
    w.f[F_PITCH] = s->pitch;
    w.f[F_ROLL] = s->roll;
    w.f[F_TURN] = s->turn_rate;
    for (int32_t k = 0; k < r->components; k++)
        w.f[F_COEF + k] = s->coef[k];
    for (int32_t k = 0; k < r->proportions; k++)
        w.f[state_layout_proportion(r) + k] = s->proportion[k];
    for (int32_t k = 0; k < r->offsets; k++)
        w.f[state_layout_offset(r) + k] = s->offset[r->angle[k]];
    pelvis_offset(r, &w, &sway, &height);
    m_sincos_one(s->heading, &sn, &cs);
    w.f[F_X] = s->pelvis[0] + sway * sn;
    w.f[F_Y] = s->pelvis[1] - sway * cs;
    w.f[F_Z] = s->pelvis[2] - height;
    return w;
}

particle_state particle_set_place(const particle_set *p, const double *weight)
{
    const float *const x = field(p, F_X), *const y = field(p, F_Y), *const z = field(p, F_Z),
                       *const stature = field(p, F_STATURE);
    double sum_x = 0.0, sum_y = 0.0, sum_z = 0.0, sum_stature = 0.0; /* independent sums */
    for (int32_t i = 0; i < p->n; i++) {
        sum_x += weight[i] * (double)x[i];
        sum_y += weight[i] * (double)y[i];
        sum_z += weight[i] * (double)z[i];
        sum_stature += weight[i] * (double)stature[i];
    }
    particle_state w = {{0}};
    w.f[F_X] = (float)sum_x;
    w.f[F_Y] = (float)sum_y;
    w.f[F_Z] = (float)sum_z;
    w.f[F_STATURE] = (float)sum_stature;
    return w;
}

typedef struct block { /* the fields of BLOCK particles */
    kin_input in;
    float turn[BLOCK]; /* the turn rate, on which no pose depends */
    float offset[GAIT_MAX_ANGLES][BLOCK];
} block;

/* Replace stride rates in in.pace by their pace, and path and level in in.pelvis by the pelvis; then curves,
 * posture and kinematics. */
static void block_bodies(const state_layout *r, block *b, kin_body *out)
{
    kin_channels ch;
    kin_input *const in = &b->in;
    for (int32_t i = 0; i < BLOCK; i++)
        in->pace[i] = state_layout_pace(r, in->pace[i]);
    r->run->kin_curves(r->model, in, r->curve_components, &ch);
    float (*const root)[BLOCK] = ch.v + r->model->root_channel;
    for (int32_t k = 0; k < r->offsets; k++)
        for (int32_t i = 0; i < BLOCK; i++)
            ch.v[r->angle[k]][i] += b->offset[k][i];
    for (int32_t i = 0; r->plain_root && i < BLOCK; i++) {
        for (int32_t c = ROOT_SWAY; c <= ROOT_YAW; c++)
            root[c][i] = 0.0f;
        root[ROOT_HEIGHT][i] = r->mean_height;
    }
    for (int32_t i = 0; i < BLOCK; i++) {
        float sn, cs, score[GAIT_MAX_PROPORTIONS];
        for (int32_t k = 0; k < r->proportions; k++)
            score[k] = in->proportion[k][i];
        float const sway = in->stature[i] * root[ROOT_SWAY][i];
        m_sincos(in->heading[i], &sn, &cs);
        in->pelvis[0][i] -= sway * sn;
        in->pelvis[1][i] += sway * cs;
        in->pelvis[2][i] += in->stature[i] * (1.0f + kin_height_change(r->model, score, r->proportions)) *
                            root[ROOT_HEIGHT][i];
    }
    r->run->kin_pose(r->model, &ch, in, r->proportions, out);
}

/* Where field f of the particles of a block is stored. */
static float *block_field(const state_layout *r, block *b, int32_t f)
{
    kin_input *const in = &b->in;
    switch (f) {
    case F_PHASE:
        return in->phase;
    case F_RATE:
        return in->pace;
    case F_X:
    case F_Y:
    case F_Z:
        return in->pelvis[f - F_X];
    case F_HEADING:
        return in->heading;
    case F_PITCH:
        return in->pitch;
    case F_ROLL:
        return in->roll;
    case F_STATURE:
        return in->stature;
    case F_TURN:
        return b->turn;
    default:
        return f < state_layout_proportion(r) ? in->coef[f - F_COEF]
               : f < state_layout_offset(r)   ? in->proportion[f - state_layout_proportion(r)]
                                              : b->offset[f - state_layout_offset(r)];
    }
}

void particle_set_bodies(const state_layout *r, const particle_set *p, int32_t begin, kin_body *out)
{
    block b;
    int32_t const whole = i_min(BLOCK, p->n - begin);
    for (int32_t f = 0; f < state_layout_fields(r); f++) {
        float *const to = block_field(r, &b, f);
        block_copy(to, field(p, f) + begin, whole);
        for (int32_t lane = whole; lane < BLOCK; lane++)
            to[lane] = to[whole - 1];
    }
    block_bodies(r, &b, out);
}

void particle_block_bodies(const state_layout *r, const particle_block *w, kin_body *out)
{
    block b;
    for (int32_t f = 0; f < state_layout_fields(r); f++)
        memcpy(block_field(r, &b, f), w->f[f], sizeof w->f[f]);
    block_bodies(r, &b, out);
}

void particle_body(const state_layout *r, const particle_state *w, kin_body *out)
{
    particle_block all;
    for (int32_t f = 0; f < state_layout_fields(r); f++)
        for (int32_t lane = 0; lane < BLOCK; lane++)
            all.f[f][lane] = w->f[f];
    particle_block_bodies(r, &all, out);
}
