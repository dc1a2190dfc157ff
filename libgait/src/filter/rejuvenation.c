#include "filter/rejuvenation.h"
#include "base/fmath.h"
#include "base/rng.h"

static const float MOST_SHRINK = 0.5f; /* beyond, particles would become copies of others again */

COLD void rejuvenation_set(rejuvenation *m, float seconds, float time)
{
    m->shrink = time > 0.0f ? f_min(1.0f - m_exp(-seconds / time), MOST_SHRINK) : 0.0f;
    m->noise = __builtin_sqrtf(m->shrink * (1.0f - m->shrink));
}

void rejuvenation_rows(const particle_set *from, int32_t begin, int32_t end, float *row)
{
    int32_t const stride = rejuvenation_stride(from->fields);
    for (int32_t f = 0; f < stride; f++) {
        float *to = row + (size_t)begin * (size_t)stride + (size_t)f;
        const float *const v = f < from->fields ? field(from, f) : NULL;
        for (int32_t i = begin; i < end; i++, to += stride)
            *to = v ? v[i] : 0.0f;
    }
}

typedef struct drawn { /* rows of a particle and of three others drawn by weight */
    const float *own, *towards, *apart[2];
} drawn;

static drawn draw(const rejuvenation *m, int32_t i)
{
    size_t const stride = (size_t)rejuvenation_stride(m->fields);
    uint32_t r[4];
    size_t at[3];
    rng_bits(m->seed, STREAM_REJUVENATION, m->frame, (uint32_t)i, 0, r);
    bool const second = !m->origin && i >= m->split;
    int32_t const first = second ? m->split : m->begin,
                  count = (second || m->origin ? m->n : m->split) - first;
    for (int32_t k = 0; k < 3; k++) {
        int32_t const other = first + (int32_t)((uint64_t)r[k] * (uint32_t)count >> 32);
        bool const apart =
            m->origin && (m->origin[i] != m->motion_class || m->origin[other] != m->motion_class);
        at[k] = (size_t)m->parent[apart ? i : other];
    }
    return (drawn){m->row + (size_t)m->parent[i] * stride,
                   m->row + at[0] * stride,
                   {m->row + at[1] * stride, m->row + at[2] * stride}};
}

static void rejuvenate_row(const rejuvenation *m, const drawn *d, float *restrict out)
{
    float const shrink = m->shrink, noise = m->noise;
    for (int32_t f = 0; f < m->fields; f += 4)
        for (int32_t k = f; k < f + 4; k++) /* four at once */
            out[k] = d->own[k] +
                     (shrink * (d->towards[k] - d->own[k]) + noise * (d->apart[0][k] - d->apart[1][k]));
}

typedef struct angles { /* per lane: the particle's own angle and its differences from others */
    float own[BLOCK], towards[BLOCK], apart[BLOCK];
} angles;

static void take_angle(const drawn *d, int32_t f, int32_t lane, angles *out)
{
    out->own[lane] = d->own[f];
    out->towards[lane] = d->towards[f] - d->own[f];
    out->apart[lane] = d->apart[0][f] - d->apart[1][f];
}

/* Angles wrap at `turn`, so differences are wrapped as well. */
static void rejuvenate_angles(const rejuvenation *m, const angles *a, float turn, float *restrict out)
{
    float const unit = TWO_PI_F / turn;
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        float const towards = m_wrap_pi(unit * a->towards[lane]), apart = m_wrap_pi(unit * a->apart[lane]);
        out[lane] = a->own[lane] + (m->shrink * towards + m->noise * apart) / unit;
    }
}

void rejuvenate_block(const rejuvenation *m, int32_t first, int32_t lanes, particle_block *out)
{
    angles phase, heading;
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        float row[(F_MAX + 3) / 4 * 4];
        drawn const d = draw(m, first + i_min(lane, lanes - 1));
        rejuvenate_row(m, &d, row);
        for (int32_t f = 0; f < m->fields; f++)
            out->f[f][lane] = row[f];
        take_angle(&d, F_PHASE, lane, &phase);
        take_angle(&d, F_HEADING, lane, &heading);
    }
    rejuvenate_angles(m, &phase, 1.0f, out->f[F_PHASE]);
    rejuvenate_angles(m, &heading, TWO_PI_F, out->f[F_HEADING]);
}
