/* Weighted sums over the particles, in SUM_LANES running sums, so that all instruction sets give the same bits.  Particles that are not dominant are multiplied by 0: for a conditional gcc 12
 * generates masked loads, with AVX2 under the wrong mask.  With a SUM_LANES below 32 gcc unrolls the inner loops before it
 * vectorises, which is slower. */
#include "base/dispatch.h"
#include "base/fmath.h"
#include <string.h>

typedef struct tail { /* the particles after the last whole SUM_LANES, filled up with weights of 0 */
    float v[3][SUM_LANES];
    double weight[SUM_LANES];
    uint8_t dominant[SUM_LANES];
} tail;

KERNEL_ROW double total(const double *lane)
{
    double sum = 0.0;
    for (int32_t i = 0; i < SUM_LANES; i++)
        sum += lane[i];
    return sum;
}

/* dominant may be NULL. */
KERNEL_ROW tail tail_of(int32_t n, int32_t count, const float *const v[], const double *weight,
                        const uint8_t *dominant)
{
    int32_t const first = n - n % SUM_LANES;
    tail rest;
    memset(&rest, 0, sizeof rest);
    for (int32_t k = 0; k < count; k++)
        memcpy(rest.v[k], v[k] + first, (size_t)(n - first) * sizeof(float));
    memcpy(rest.weight, weight + first, (size_t)(n - first) * sizeof(double));
    if (dominant)
        memcpy(rest.dominant, dominant + first, (size_t)(n - first));
    return rest;
}

/* ---- moments ---- */
KERNEL_ROW void moments_add(const float *restrict v, const double *restrict weight,
                            const uint8_t *restrict dominant, int32_t n, double about,
                            double (*restrict sum)[SUM_LANES])
{
    for (int32_t i = 0; i < n; i += SUM_LANES)
        for (int32_t lane = 0; lane < SUM_LANES; lane++) {
            double const d = (double)v[i + lane] - about, wd = weight[i + lane] * d;
            sum[0][lane] += wd;
            sum[1][lane] += wd * d;
            sum[2][lane] += (double)dominant[i + lane] * wd;
        }
}

void KERNEL(estimate_moments)(const float *v, const double *weight, const uint8_t *dominant, int32_t n,
                              double about, double (*sum)[SUM_LANES])
{
    tail const rest = tail_of(n, 1, &v, weight, dominant);
    moments_add(v, weight, dominant, n - n % SUM_LANES, about, sum);
    moments_add(rest.v[0], rest.weight, rest.dominant, SUM_LANES, about, sum);
}

/* ---- directions ---- */
KERNEL_ROW void terms_add(const float (*restrict term)[SUM_LANES], int32_t count,
                          const double *restrict weight, double (*restrict sum)[SUM_LANES])
{
    for (int32_t k = 0; k < count; k++)
        for (int32_t lane = 0; lane < SUM_LANES; lane++)
            sum[k][lane] += weight[lane] * (double)term[k][lane];
}

/* The weights of the particles of the dominant hypothesis, 0 for the others. */
KERNEL_ROW void dominant_weights(const double *restrict weight, const uint8_t *restrict dominant,
                                 double *restrict out)
{
    for (int32_t lane = 0; lane < SUM_LANES; lane++)
        out[lane] = (double)dominant[lane] * weight[lane];
}

KERNEL_ROW void directions(const float *restrict angle, float turn, float (*restrict out)[SUM_LANES])
{
    for (int32_t lane = 0; lane < SUM_LANES; lane++)
        m_sincos(turn * angle[lane], &out[1][lane], &out[0][lane]);
}

static void resultant_add(const float *angle, float turn, const double *weight, const uint8_t *dominant,
                          int32_t n, double (*sum)[SUM_LANES])
{
    float cs[2][SUM_LANES];
    double dominant_weight[SUM_LANES];
    for (int32_t i = 0; i < n; i += SUM_LANES) {
        directions(angle + i, turn, cs);
        dominant_weights(weight + i, dominant + i, dominant_weight);
        terms_add((const float (*)[SUM_LANES])cs, 2, weight + i, sum);
        terms_add((const float (*)[SUM_LANES])cs, 2, dominant_weight, sum + 2);
    }
}

void KERNEL(estimate_resultant)(const float *angle, float turn, const double *weight, const uint8_t *dominant,
                                int32_t n, double out[4])
{
    tail const rest = tail_of(n, 1, &angle, weight, dominant);
    double sum[4][SUM_LANES] = {{0.0}};
    resultant_add(angle, turn, weight, dominant, n - n % SUM_LANES, sum);
    resultant_add(rest.v[0], turn, rest.weight, rest.dominant, SUM_LANES, sum);
    for (int32_t k = 0; k < 4; k++)
        out[k] = total(sum[k]);
}

/* All differences are stored before they are wrapped: for m_wrap_pi of a difference gcc generates branches. */
KERNEL_ROW void near_to(const float *restrict phase, const float *restrict heading, float phase0,
                        float heading0, uint8_t *restrict dominant)
{
    float const near_phase = 0.15f * TWO_PI_F, near_heading = 0.5f;
    float off[2 * SUM_LANES];
    for (int32_t i = 0; i < SUM_LANES; i++) {
        off[i] = TWO_PI_F * (phase[i] - phase0);
        off[SUM_LANES + i] = heading[i] - heading0;
    }
    for (int32_t i = 0; i < 2 * SUM_LANES; i++)
        off[i] = fabsf(m_wrap_pi(off[i]));
    for (int32_t i = 0; i < SUM_LANES; i++)
        dominant[i] = (uint8_t)(m_less(off[i], near_phase) & m_less(off[SUM_LANES + i], near_heading) & 1u);
}

KERNEL_ROW void weight_add(const double *restrict weight, const uint8_t *restrict dominant,
                           double *restrict sum)
{
    for (int32_t lane = 0; lane < SUM_LANES; lane++)
        sum[lane] += (double)dominant[lane] * weight[lane];
}

double KERNEL(estimate_dominant)(const float *phase, const float *heading, const double *weight, int32_t n,
                                 int32_t best, uint8_t *dominant)
{
    const float *const angles[] = {phase, heading};
    double sum[SUM_LANES] = {0.0};
    int32_t const whole = n - n % SUM_LANES;
    tail rest = tail_of(n, 2, angles, weight, NULL);
    for (int32_t i = 0; i < whole; i += SUM_LANES) {
        near_to(phase + i, heading + i, phase[best], heading[best], dominant + i);
        weight_add(weight + i, dominant + i, sum);
    }
    near_to(rest.v[0], rest.v[1], phase[best], heading[best], rest.dominant);
    weight_add(rest.weight, rest.dominant, sum);
    memcpy(dominant + whole, rest.dominant, (size_t)(n - whole));
    return total(sum);
}

/* ---- rotations ---- */
enum { PAIRS = 10 };

/* Products of the components of the quaternion of Rz(heading) Ry(pitch) Rx(roll), w x y z. */
KERNEL_ROW void pairs_of(const float *restrict heading, const float *restrict pitch,
                         const float *restrict roll, float (*restrict pair)[SUM_LANES])
{
    float h[2][SUM_LANES], p[2][SUM_LANES], r[2][SUM_LANES];
    directions(heading, 0.5f, h);
    directions(pitch, 0.5f, p);
    directions(roll, 0.5f, r);
    for (int32_t i = 0; i < SUM_LANES; i++) {
        float const ch = h[0][i], sh = h[1][i], cp = p[0][i], sp = p[1][i], cr = r[0][i], sr = r[1][i];
        float const w = ch * cp * cr + sh * sp * sr, x = ch * cp * sr - sh * sp * cr;
        float const y = ch * sp * cr + sh * cp * sr, z = sh * cp * cr - ch * sp * sr;
        pair[0][i] = w * w;
        pair[1][i] = w * x;
        pair[2][i] = w * y;
        pair[3][i] = w * z;
        pair[4][i] = x * x;
        pair[5][i] = x * y;
        pair[6][i] = x * z;
        pair[7][i] = y * y;
        pair[8][i] = y * z;
        pair[9][i] = z * z;
    }
}

static void rotations_add(const float *heading, const float *pitch, const float *roll, const double *weight,
                          const uint8_t *dominant, int32_t n, double (*sum)[SUM_LANES])
{
    float pair[PAIRS][SUM_LANES];
    double dominant_weight[SUM_LANES];
    for (int32_t i = 0; i < n; i += SUM_LANES) {
        pairs_of(heading + i, pitch + i, roll + i, pair);
        dominant_weights(weight + i, dominant + i, dominant_weight);
        terms_add((const float (*)[SUM_LANES])pair, PAIRS, dominant_weight, sum);
    }
}

void KERNEL(estimate_rotations)(const float *heading, const float *pitch, const float *roll,
                                const double *weight, const uint8_t *dominant, int32_t n, double out[16])
{
    static const uint8_t place[16] = {0, 1, 2, 3, 1, 4, 5, 6, 2, 5, 7, 8, 3, 6, 8, 9};
    tail const rest = tail_of(n, 3, (const float *const[]){heading, pitch, roll}, weight, dominant);
    double sum[PAIRS][SUM_LANES] = {{0.0}};
    rotations_add(heading, pitch, roll, weight, dominant, n - n % SUM_LANES, sum);
    rotations_add(rest.v[0], rest.v[1], rest.v[2], rest.weight, rest.dominant, SUM_LANES, sum);
    for (int32_t k = 0; k < 16; k++)
        out[k] = total(sum[place[k]]);
}
