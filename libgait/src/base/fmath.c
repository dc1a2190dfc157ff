#include "base/fmath.h"

#define LN2_HI 6.93147180369123816490e-01 /* 33 bits: its product with an exponent is exact */
#define LN2_LO 1.90821492927058770002e-10

float m_wrap_pi_one(float x)
{
    return m_wrap_pi(x);
}

static double from_bits64(uint64_t u)
{
    double x;
    memcpy(&x, &u, sizeof x);
    return x;
}

enum { SIMD16 = 16 }; /* independent divisions */

static void exp_lanes(const double *restrict x, double *restrict out)
{
    double const magic = 6755399441055744.0; /* 1.5 * 2^52 */
    double r[SIMD16], scale[SIMD16], p[SIMD16];
    for (int32_t i = 0; i < SIMD16; i++) {
        double const y = x[i] > -708.0 ? x[i] < 709.0 ? x[i] : 709.0 : -708.0;
        double const k = (y * 1.44269504088896340736 + magic) - magic; /* in [-1021, 1023] */
        r[i] = (y - k * LN2_HI) - k * LN2_LO;
        scale[i] = x[i] > -708.0 ? from_bits64((uint64_t)((int32_t)k + 1023) << 52) : 0.0;
        p[i] = 1.0;
    }
    /* Taylor series: |r| <= ln(2)/2, so the first term left out is below 5e-18. */
#pragma GCC unroll 1
    for (int n = 13; n > 0; n--)
#pragma GCC unroll 1
        for (int32_t i = 0; i < SIMD16; i++)
            p[i] = p[i] * r[i] / n + 1.0;
    for (int32_t i = 0; i < SIMD16; i++)
        out[i] = p[i] * scale[i];
}

void m_exp64_all(const double *x, int32_t n, double *out)
{
    int32_t const whole = n - n % SIMD16;
    double end[2][SIMD16] = {{0.0}};
    for (int32_t i = 0; i < whole; i += SIMD16)
        exp_lanes(x + i, out + i);
    memcpy(end[0], x + whole, (size_t)(n - whole) * sizeof *x);
    exp_lanes(end[0], end[1]);
    memcpy(out + whole, end[1], (size_t)(n - whole) * sizeof *out);
}

double m_exp64(double x)
{
    double out;
    m_exp64_all(&x, 1, &out);
    return out;
}

double m_log64(double x)
{
    double const y = x > DBL_MIN ? (x < DBL_MAX ? x : DBL_MAX) : DBL_MIN;
    uint64_t const sqrt_half = UINT64_C(0x3fe6a09e667f3bcd), mantissa = (UINT64_C(1) << 52) - 1;
    uint64_t bits;
    memcpy(&bits, &y, sizeof bits);
    bits += (UINT64_C(1023) << 52) - sqrt_half;
    double const k = (double)((int32_t)(bits >> 52) - 1023);
    double const f = from_bits64((bits & mantissa) + sqrt_half) - 1.0;
    /* log(1 + f) = 2 atanh(s) = f - f^2/2 + s (f^2/2 + R), |s| < 0.172 */
    double const s = f / (2.0 + f), z = s * s, half = 0.5 * f * f;
    double r = 0.0;
    for (int n = 21; n >= 3; n -= 2)
        r = r * z + 2.0 / n;
    return k * LN2_HI - ((half - (s * (half + r * z) + k * LN2_LO)) - f);
}

void m_sincos64(double x, double *s, double *c)
{
    double const magic = 6755399441055744.0; /* 1.5 * 2^52 */
    double const k = (x * 0.63661977236758134308 + magic) - magic;
    /* pi/2 in three parts of 33 bits: products with a small k are exact */
    double const r =
        ((x - k * 1.57079632673412561417) - k * 6.07710050630396597660e-11) - k * 2.02226624879595063154e-21;
    double const z = r * r;
    double sn = 1.0, cs = 1.0; /* Taylor series: |r| <= pi/4, so the first terms left out are below 1e-18 */
    for (int n = 18; n > 1; n -= 2) {
        sn = 1.0 - sn * z / (n * (n + 1));
        cs = 1.0 - cs * z / (n * (n - 1));
    }
    sn *= r;
    int32_t const quadrant = fabs(k) < 1e9 ? (int32_t)k & 3 : 0;
    *s = quadrant == 0 ? sn : quadrant == 1 ? cs : quadrant == 2 ? -sn : -cs;
    *c = quadrant == 0 ? cs : quadrant == 1 ? -sn : quadrant == 2 ? -cs : sn;
}

void m_sincos_one(float x, float *s, float *c)
{
    m_sincos(x, s, c);
}

float m_atan2(float y, float x)
{
    float const ax = fabsf(x), ay = fabsf(y);
    float const lo = f_min(ax, ay), hi = f_max(f_max(ax, ay), FLT_MIN);
    /* over 22.5 degrees: atan t = pi/4 + atan((t - 1)/(t + 1)) */
    uint32_t const fold = m_less(0.41421356f * hi, lo);
    float const t = m_select(fold, lo - hi, lo) / m_select(fold, lo + hi, hi);
    float const z = t * t;
    float p = (8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f;
    p = p * z - 3.33329491539e-1f;
    float a = p * z * t + t + m_select(fold, 0.25f * PI_F, 0.0f);
    a = m_select(m_less(ax, ay), 0.5f * PI_F - a, a);
    a = m_select(m_less(x, 0.0f), PI_F - a, a);
    return m_from_bits(m_bits(a) | (m_bits(y) & 0x80000000u));
}

double m_median(double *x, int32_t count)
{
    int32_t const middle = count / 2;
    for (int32_t low = 0, high = count - 1; low < high;) { /* quickselect */
        double const pivot = x[low + (high - low) / 2];
        int32_t i = low, k = high;
        while (i <= k) {
            for (; x[i] < pivot; i++)
                ;
            for (; pivot < x[k]; k--)
                ;
            if (i > k)
                break;
            double const other = x[i];
            x[i++] = x[k];
            x[k--] = other;
        }
        if (middle <= k)
            high = k;
        else if (middle >= i)
            low = i;
        else
            break;
    }
    return x[middle];
}
