/* Sums over the weighted particles: of every LANES-th one, then over the lanes in order.  Those not in use are
 * multiplied by 0: of a choice gcc 12 makes masked loads, with AVX2 under the wrong
 * mask.  LANES: below 32 it unrolls the loops over them first and then finds less to do at once. */
#include "base/fmath.h"
#include "base/dispatch.h"
#include <string.h>

enum { SIMD16 = 64 };

typedef struct ends { /* the particles after the last whole LANES, and none that weigh anything */
    float v[3][SIMD16];
    double weight[SIMD16];
    uint8_t use[SIMD16];
} ends;

KERNEL_ROW double total(const double *lane)
{
    double sum = 0.0;
    for (int32_t i = 0; i < SIMD16; i++)
        sum += lane[i];
    return sum;
}

/* Particles first .. n - 1; use may be NULL. */
KERNEL_ROW ends ends_of(int32_t n, int32_t count, const float *const v[], const double *weight,
                        const uint8_t *use)
{
    int32_t const first = n - n % SIMD16;
    ends e;
    memset(&e, 0, sizeof e);
    for (int32_t k = 0; k < count; k++)
        memcpy(e.v[k], v[k] + first, (size_t)(n - first) * sizeof(float));
    memcpy(e.weight, weight + first, (size_t)(n - first) * sizeof(double));
    if (use)
        memcpy(e.use, use + first, (size_t)(n - first));
    return e;
}

/* ---- moments ---- */
KERNEL_ROW void moments_add(const float *restrict v, const double *restrict weight,
                            const uint8_t *restrict use, int32_t n, double about,
                            double (*restrict sum)[SIMD16])
{
    for (int32_t i = 0; i < n; i += SIMD16)
        for (int32_t lane = 0; lane < SIMD16; lane++) {
            double const d = (double)v[i + lane] - about, wd = weight[i + lane] * d;
            sum[0][lane] += wd;
            sum[1][lane] += wd * d;
            sum[2][lane] += (double)use[i + lane] * wd;
        }
}

void KERNEL(estimate_moments)(const float *v, const double *weight, const uint8_t *use, int32_t n,
                              double about, double out[3])
{
    ends const e = ends_of(n, 1, &v, weight, use);
    double sum[3][SIMD16] = {{0.0}};
    moments_add(v, weight, use, n - n % SIMD16, about, sum);
    moments_add(e.v[0], e.weight, e.use, SIMD16, about, sum);
    for (int32_t k = 0; k < 3; k++)
        out[k] = total(sum[k]);
}

/* ---- directions ---- */
KERNEL_ROW void terms_add(const float (*restrict term)[SIMD16], int32_t count, const double *restrict weight,
                          double (*restrict sum)[SIMD16])
{
    for (int32_t k = 0; k < count; k++)
        for (int32_t lane = 0; lane < SIMD16; lane++)
            sum[k][lane] += weight[lane] * (double)term[k][lane];
}

/* The weights of those in use. */
KERNEL_ROW void weights_used(const double *restrict weight, const uint8_t *restrict use, double *restrict out)
{
    for (int32_t lane = 0; lane < SIMD16; lane++)
        out[lane] = (double)use[lane] * weight[lane];
}

KERNEL_ROW void directions(const float *restrict angle, float turn, float (*restrict out)[SIMD16])
{
    for (int32_t lane = 0; lane < SIMD16; lane++)
        m_sincos(turn * angle[lane], &out[1][lane], &out[0][lane]);
}

static void resultant_add(const float *angle, float turn, const double *weight, const uint8_t *use, int32_t n,
                          double (*sum)[SIMD16])
{
    float cs[2][SIMD16];
    double used[SIMD16];
    for (int32_t i = 0; i < n; i += SIMD16) {
        directions(angle + i, turn, cs);
        weights_used(weight + i, use + i, used);
        terms_add((const float (*)[SIMD16])cs, 2, weight + i, sum);
        terms_add((const float (*)[SIMD16])cs, 2, used, sum + 2);
    }
}

void KERNEL(estimate_resultant)(const float *angle, float turn, const double *weight, const uint8_t *use,
                                int32_t n, double out[4])
{
    ends const e = ends_of(n, 1, &angle, weight, use);
    double sum[4][SIMD16] = {{0.0}};
    resultant_add(angle, turn, weight, use, n - n % SIMD16, sum);
    resultant_add(e.v[0], turn, e.weight, e.use, SIMD16, sum);
    for (int32_t k = 0; k < 4; k++)
        out[k] = total(sum[k]);
}

/* All angles in one array before they are wrapped: of m_wrap_pi of a difference gcc makes branches. */
KERNEL_ROW void near_to(const float *restrict phase, const float *restrict heading, float phase0,
                        float heading0, uint8_t *restrict use)
{
    float const near_phase = 0.15f * TWO_PI_F, near_heading = 0.5f;
    float off[2 * SIMD16];
    for (int32_t i = 0; i < SIMD16; i++) {
        off[i] = TWO_PI_F * (phase[i] - phase0);
        off[SIMD16 + i] = heading[i] - heading0;
    }
    for (int32_t i = 0; i < 2 * SIMD16; i++)
        off[i] = fabsf(m_wrap_pi(off[i]));
    for (int32_t i = 0; i < SIMD16; i++)
        use[i] = (uint8_t)(m_less(off[i], near_phase) & m_less(off[SIMD16 + i], near_heading) & 1u);
}

KERNEL_ROW void mass_add(const double *restrict weight, const uint8_t *restrict use, double *restrict sum)
{
    for (int32_t lane = 0; lane < SIMD16; lane++)
        sum[lane] += (double)use[lane] * weight[lane];
}

double KERNEL(estimate_mode)(const float *phase, const float *heading, const double *weight, int32_t n,
                             int32_t best, uint8_t *use)
{
    const float *const angles[] = {phase, heading};
    double sum[SIMD16] = {0.0};
    int32_t const whole = n - n % SIMD16;
    ends e = ends_of(n, 2, angles, weight, NULL);
    for (int32_t i = 0; i < whole; i += SIMD16) {
        near_to(phase + i, heading + i, phase[best], heading[best], use + i);
        mass_add(weight + i, use + i, sum);
    }
    near_to(e.v[0], e.v[1], phase[best], heading[best], e.use);
    mass_add(e.weight, e.use, sum);
    memcpy(use + whole, e.use, (size_t)(n - whole));
    return total(sum);
}

/* ---- rotations ---- */
enum { PAIRS = 10 };

/* Products of the components of the quaternion of Rz(heading) Ry(pitch) Rx(roll), w x y z. */
KERNEL_ROW void pairs_of(const float *restrict heading, const float *restrict pitch,
                         const float *restrict roll, float (*restrict pair)[SIMD16])
{
    for (int32_t i = 0; i < SIMD16; i++) {
        float sh, ch, sp, cp, sr, cr;
        m_sincos(0.5f * heading[i], &sh, &ch);
        m_sincos(0.5f * pitch[i], &sp, &cp);
        m_sincos(0.5f * roll[i], &sr, &cr);
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
                          const uint8_t *use, int32_t n, double (*sum)[SIMD16])
{
    float pair[PAIRS][SIMD16];
    double used[SIMD16];
    for (int32_t i = 0; i < n; i += SIMD16) {
        pairs_of(heading + i, pitch + i, roll + i, pair);
        weights_used(weight + i, use + i, used);
        terms_add((const float (*)[SIMD16])pair, PAIRS, used, sum);
    }
}

void KERNEL(estimate_rotations)(const float *heading, const float *pitch, const float *roll,
                                const double *weight, const uint8_t *use, int32_t n, double out[16])
{
    static const uint8_t place[16] = {0, 1, 2, 3, 1, 4, 5, 6, 2, 5, 7, 8, 3, 6, 8, 9};
    ends const e = ends_of(n, 3, (const float *const[]){heading, pitch, roll}, weight, use);
    double sum[PAIRS][SIMD16] = {{0.0}};
    rotations_add(heading, pitch, roll, weight, use, n - n % SIMD16, sum);
    rotations_add(e.v[0], e.v[1], e.v[2], e.weight, e.use, SIMD16, sum);
    for (int32_t k = 0; k < 16; k++)
        out[k] = total(sum[place[k]]);
}
