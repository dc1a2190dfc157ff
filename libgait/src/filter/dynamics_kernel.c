/* One interval of BLOCK particles, one per lane: eqs. 5-9 with the details of doc/method.md. */
#include "filter/dynamics.h"
#include "base/fmath.h"
#include "base/dispatch.h"
#include "base/rng.h"

enum { NORMALS = 4 * ((F_MAX + 2 + 3) / 4) }; /* one per field, and two for new turn rates */

KERNEL_ROW void words(uint64_t seed, uint32_t frame, uint32_t first, uint32_t draw,
                      uint32_t (*restrict out)[BLOCK])
{
    for (uint32_t lane = 0; lane < BLOCK; lane++) {
        uint32_t w[4];
        rng_words(seed, STREAM_MOVE, frame, first + lane, draw, w);
#pragma GCC unroll 4
        for (int32_t k = 0; k < 4; k++)
            out[k][lane] = w[k];
    }
}

KERNEL_ROW void normal_pair(const uint32_t (*restrict bits)[BLOCK], float (*restrict out)[BLOCK])
{
    for (int32_t lane = 0; lane < BLOCK; lane++)
        rng_normal_pair(bits[0][lane], bits[1][lane], &out[0][lane], &out[1][lane]);
}

/* Four standard normals of each of BLOCK particles from `first` on. */
static void normals(uint64_t seed, uint32_t frame, uint32_t first, uint32_t draw, float (*out)[BLOCK])
{
    uint32_t bits[4][BLOCK];
    words(seed, frame, first, draw, bits);
    normal_pair((const uint32_t (*)[BLOCK])bits, out);
    normal_pair((const uint32_t (*)[BLOCK])bits + 2, out + 2);
}

KERNEL_ROW void relax(relaxing r, const float *restrict x, const float *restrict n, float *restrict out)
{
    for (int32_t lane = 0; lane < BLOCK; lane++)
        out[lane] = r.keep * x[lane] + r.noise * n[lane];
}

/* Eqs. 6 and 7: the phase advances by the previous rate; the rate diffuses. */
KERNEL_ROW void advance(const dynamics_step *s, const particle_block *restrict from,
                        const float (*restrict n)[BLOCK], float *restrict turn, particle_block *restrict to)
{
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        float const rate = from->f[F_RATE][lane];
        turn[lane] = rate * s->phase_dt + s->phase_noise * n[0][lane];
        to->f[F_PHASE][lane] = m_wrap1(from->f[F_PHASE][lane] + turn[lane]);
        float const off = s->rate.keep * (rate - s->mean_rate) + s->rate.noise * n[1][lane];
        to->f[F_RATE][lane] = dynamics_reflect_rate(s->mean_rate + off);
    }
}

/* Forward speed in the middle of the interval, statures per stride: eq. 3 for one channel. */
KERNEL_ROW void speeds(const dynamics_step *s, const particle_block *restrict from,
                       const float *restrict turn, float *restrict out)
{
    const gait_model *const m = s->model;
    int32_t const T = m->phases, M = m->channels;
    int32_t here[BLOCK], next[BLOCK];
    float w[BLOCK], one[BLOCK], pace[BLOCK];
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        float const at = m_wrap1(from->f[F_PHASE][lane] + 0.5f * turn[lane]) * (float)T;
        int32_t const j = i_min((int32_t)at, T - 1);
        here[lane] = j * M;
        next[lane] = (j + 1 < T ? j + 1 : 0) * M;
        w[lane] = at - (float)j;
        out[lane] = 0.0f;
        one[lane] = 1.0f;
    }
    for (int32_t lane = 0; lane < BLOCK; lane++)
        pace[lane] = kin_pace(m, from->f[F_RATE][lane]);
    for (int32_t k = m->pace_curve ? -1 : 0; k <= s->components; k++) {
        const float *const curve = (k < 0 ? m->pace_curve : m->curves + (size_t)k * (size_t)T * (size_t)M) +
                                   m->root_channel + ROOT_FORWARD;
        const float *const c = k < 0 ? pace : k ? from->f[F_COEF + k - 1] : one;
        for (int32_t lane = 0; lane < BLOCK; lane++)
            out[lane] +=
                c[lane] * (1.0f - w[lane]) * curve[here[lane]] + c[lane] * w[lane] * curve[next[lane]];
    }
}

/* Eq. 8: move along the heading by the speed (statures per stride) times the advance of the phase. */
KERNEL_ROW void walk(const dynamics_step *s, const particle_block *restrict from,
                     const float (*restrict n)[BLOCK], const float *restrict turn,
                     const float *restrict speed, particle_block *restrict to)
{
    float heading[BLOCK];
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        float const ahead =
            from->f[F_STATURE][lane] * speed[lane] * turn[lane] * s->travel + s->forward_noise * n[2][lane];
        float const aside = s->lateral_noise * n[3][lane];
        float const curve = from->f[F_TURN][lane] * s->dt;
        float sn, cs;
        m_sincos(from->f[F_HEADING][lane] + 0.5f * curve, &sn, &cs);
        to->f[F_X][lane] = from->f[F_X][lane] + (ahead * cs - aside * sn);
        to->f[F_Y][lane] = from->f[F_Y][lane] + (ahead * sn + aside * cs);
        heading[lane] = from->f[F_HEADING][lane] + curve + s->heading_noise * n[5][lane];
    }
    for (int32_t lane = 0; lane < BLOCK; lane++)
        to->f[F_HEADING][lane] = m_wrap_pi(heading[lane]);
}

/* Now and then a particle draws a new turn rate, half of the time 0. If the turn rate diffused all the time instead,
 * swaying hips would be taken for turning. a and b are normal, so (a, b) is a point
 * with an exponentially distributed square and a uniform direction. */
KERNEL_ROW void take_turns(const dynamics_step *s, const float *restrict a, const float *restrict b,
                           const float *restrict n, const float *restrict x, float *restrict out)
{
    for (int32_t lane = 0; lane < BLOCK; lane++) {
        float const square = a[lane] * a[lane] + b[lane] * b[lane];
        float const other = m_select(m_less(0.0f, a[lane]), s->turn_sd * n[lane], 0.0f);
        out[lane] = m_select(m_less(s->turn_beyond, square), other, x[lane]);
    }
}

KERNEL_ROW void grow(const dynamics_step *s, const float *restrict x, const float *restrict n,
                     float *restrict out)
{
    for (int32_t lane = 0; lane < BLOCK; lane++)
        out[lane] = f_max(x[lane] * (1.0f + s->stature_noise * n[lane]), LEAST_STATURE);
}

void KERNEL(dynamics_move)(const dynamics_step *s, int32_t first, const particle_block *from,
                           particle_block *to)
{
    float n[NORMALS][BLOCK], turn[BLOCK], speed[BLOCK];
    for (int32_t k = 0; k < s->fields + 2; k += 4)
        normals(s->seed, s->frame, (uint32_t)first, (uint32_t)(k / 4), n + k);
    advance(s, from, (const float (*)[BLOCK])n, turn, to);
    if (s->plain_root)
        for (int32_t lane = 0; lane < BLOCK; lane++) {
            speed[lane] = s->model->stride_length;
            turn[lane] = from->f[F_RATE][lane] * s->phase_dt;
        }
    else
        speeds(s, from, turn, speed);
    walk(s, from, (const float (*)[BLOCK])n, turn, speed, to);
    /* eq. 9, and the level of the ground: level, pitch and roll relax to the model's own */
    relax(s->level, from->f[F_Z], n[4], to->f[F_Z]);
    relax(s->tilt, from->f[F_PITCH], n[6], to->f[F_PITCH]);
    relax(s->tilt, from->f[F_ROLL], n[7], to->f[F_ROLL]);
    take_turns(s, n[s->fields], n[s->fields + 1], n[9], from->f[F_TURN], to->f[F_TURN]);
    grow(s, from->f[F_STATURE], n[8], to->f[F_STATURE]);
    /* the scores relax to the mean of people (eq. 5); proportions and posture hardly change */
    for (int32_t k = F_COEF; k < s->fields; k++)
        relax(k < s->proportion ? s->score
              : k < s->offset   ? s->shape
                                : s->posture[k - s->offset],
              from->f[k], n[k], to->f[k]);
}
