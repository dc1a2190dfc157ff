#include "mingle.h"
#include "fmath.h"
#include "rng.h"

enum { OTHERS = 3 };

void mingling_set(mingling *m, float seconds, float time)
{
    m->pull = time > 0.0f ? 1.0f - m_exp(-seconds / time) : 0.0f;
    m->spread = __builtin_sqrtf(m->pull * (1.0f - m->pull));
}

/* Three particles for each lane, drawn by weight. */
static void draw_others(const mingling *m, int32_t first, int32_t lanes, int32_t other[OTHERS][BLOCK])
{
    for (int32_t lane = 0; lane < lanes; lane++) {
        uint32_t r[4];
        rng_bits(m->seed, STREAM_MINGLE, m->frame, (uint32_t)(first + lane), 0, r);
        for (int32_t k = 0; k < OTHERS; k++)
            other[k][lane] = m->parent[(uint64_t)r[k] * (uint32_t)m->n >> 32];
    }
}

/* Move one field of every lane. */
static void mingle_field(const mingling *m, int32_t lanes, const float *x, int32_t other[OTHERS][BLOCK],
                         float *v)
{
    for (int32_t lane = 0; lane < lanes; lane++)
        v[lane] +=
            m->pull * (x[other[0][lane]] - v[lane]) + m->spread * (x[other[1][lane]] - x[other[2][lane]]);
}

/* The same where differences go round: of a turn, in units of it. */
static void mingle_angle(const mingling *m, int32_t lanes, const float *x, int32_t other[OTHERS][BLOCK],
                         float turn, float *v)
{
    float const unit = TWO_PI_F / turn;
    for (int32_t lane = 0; lane < lanes; lane++) {
        float const towards = m_wrap_pi(unit * (x[other[0][lane]] - v[lane]));
        float const apart = m_wrap_pi(unit * (x[other[1][lane]] - x[other[2][lane]]));
        v[lane] += (m->pull * towards + m->spread * apart) / unit;
    }
}

void mingle_block(const mingling *m, int32_t first, int32_t lanes, walker_block *w)
{
    int32_t other[OTHERS][BLOCK];
    if (!(m->pull > 0.0f))
        return;
    draw_others(m, first, lanes, other);
    for (int32_t f = 0; f < m->from->fields; f++) {
        const float *const x = field(m->from, f);
        if (f == F_PHASE || f == F_HEADING)
            mingle_angle(m, lanes, x, other, f == F_PHASE ? 1.0f : TWO_PI_F, w->f[f]);
        else
            mingle_field(m, lanes, x, other, w->f[f]);
    }
}
