#include "filter/mirror.h"
#include "base/fmath.h"

/* Signed axis (1 x, 2 y, 3 z) about which a channel rotates its frame; 0: none. */
static int32_t axis_of(const gait_model *m, int32_t channel)
{
    for (int32_t f = 0; f < m->frames; f++) {
        const int32_t *const info = m->frame_info + f * FRAME_INFO;
        for (int32_t k = 0; k < info[1]; k++)
            if (info[3 + 2 * k] == channel)
                return info[2 + 2 * k];
    }
    return 0;
}

/* The reflection y -> -y keeps rotations about y and reverses those about x and z. */
static float mirror_sign(const gait_model *m, int32_t channel, int32_t partner)
{
    int32_t const root = channel - m->root_channel, a = axis_of(m, channel), b = axis_of(m, partner);
    if (root >= 0)
        return root == ROOT_SWAY || root == ROOT_ROLL || root == ROOT_YAW ? -1.0f : 1.0f;
    bool const keeps = a == 2 || a == -2, same_sense = (a < 0) == (b < 0);
    return keeps == same_sense ? 1.0f : -1.0f;
}

/* Curve k (0: mean) in the mirror, half a stride later, at sample j. */
static float mirrored(const mirror *x, const gait_model *m, int32_t k, int32_t j, int32_t channel)
{
    int32_t const half = (j + m->phases / 2) % m->phases;
    return x->sign[channel] * m->curves[((size_t)k * (size_t)m->phases + (size_t)half) * (size_t)m->channels +
                                        (size_t)x->partner[channel]];
}

/* Inner products over phases and angles of component i with the mirrored curve k (minus the mean for k = 0),
 * and with itself. */
static void project(const mirror *x, const gait_model *m, int32_t i, int32_t k, double *with, double *own)
{
    *with = *own = 0.0;
    for (int32_t j = 0; j < m->phases; j++)
        for (int32_t c = 0; c < m->angles; c++) {
            float const *const row = m->curves + (size_t)j * (size_t)m->channels + c;
            size_t const plane = (size_t)m->phases * (size_t)m->channels;
            float const v = row[(size_t)(i + 1) * plane];
            float const y = mirrored(x, m, k, j, c) - (k == 0 ? row[0] : 0.0f);
            *with += (double)v * (double)y;
            *own += (double)v * (double)v;
        }
}

void mirror_init(mirror *x, const state_layout *r)
{
    const gait_model *const m = r->model;
    x->components = r->curve_components;
    for (int32_t c = 0; c < m->channels; c++) {
        x->partner[c] = model_other_side(m->channel_name, m->channels, c);
        x->sign[c] = mirror_sign(m, c, x->partner[c]);
    }
    for (int32_t i = 0; i < x->components; i++)
        for (int32_t k = 0; k <= x->components; k++) {
            double with, own;
            project(x, m, i, k, &with, &own);
            float const share = own > 0.0 ? (float)(with / own) : 0.0f;
            if (k == 0)
                x->shift[i] = share;
            else
                x->mix[i][k - 1] = share;
        }
}

particle_state mirror_apply(const mirror *x, const state_layout *r, const particle_state *w)
{
    particle_state to = *w;
    to.f[F_PHASE] = m_wrap1(w->f[F_PHASE] + 0.5f);
    to.f[F_ROLL] = -w->f[F_ROLL];
    for (int32_t i = 0; i < x->components; i++) {
        to.f[F_COEF + i] = x->shift[i];
        for (int32_t k = 0; k < x->components; k++)
            to.f[F_COEF + i] += x->mix[i][k] * w->f[F_COEF + k];
    }
    const float *const offset = w->f + state_layout_offset(r);
    for (int32_t i = 0; i < r->offsets; i++)
        for (int32_t k = 0; k < r->offsets; k++)
            if (r->angle[k] == x->partner[r->angle[i]])
                to.f[state_layout_offset(r) + i] = x->sign[r->angle[i]] * offset[k];
    return to;
}
