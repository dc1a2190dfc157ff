/* fmath.h - float functions that give the same bits with every compiler and CPU: polynomials after Moshier's
 * Cephes, only IEEE + - * / and sqrt, no tables, no branches (so that loops over lanes vectorise), no
 * undefined conversions. They need rounding to nearest, -ffp-contract=off and no -ffast-math. The stated
 * errors are the maxima measured by tests/unit/test_fmath.c against libm in double precision. */
#ifndef GAIT_BASE_FMATH_H
#define GAIT_BASE_FMATH_H
#include "base/base.h"

#include <string.h>

static inline uint32_t m_bits(float x)
{
    uint32_t u;
    memcpy(&u, &x, sizeof u);
    return u;
}

static inline float m_from_bits(uint32_t u)
{
    float x;
    memcpy(&x, &u, sizeof x);
    return x;
}

/* a where take is all ones, b where it is 0. Every compiler turns this select into vector code. */
static inline float m_select(uint32_t take, float a, float b)
{
    return m_from_bits((m_bits(a) & take) | (m_bits(b) & ~take));
}

/* All ones if a < b, else 0. */
static inline uint32_t m_less(float a, float b)
{
    return 0u - (uint32_t)(a < b);
}

/* Exact, because every float beyond 2^23 is an integer. NaN stays NaN. */
static inline float m_floor(float x)
{
    float const y = f_clamp(x, -8388608.0f, 8388607.0f);
    float const t = (float)(int32_t)y;
    return m_select(m_less(fabsf(x), 8388608.0f), t - (t > y ? 1.0f : 0.0f), x);
}

/* Nearest integer, ties to even, for |x| < 2^22. */
static inline float m_round(float x)
{
    float const magic = 12582912.0f; /* 1.5 * 2^23: adding it drops the fraction */
    return (x + magic) - magic;
}

/* x modulo 1 in [0, 1). Exact except for the last rounding of a negative x. NaN gives 0. */
static inline float m_wrap1(float x)
{
    float const f = x - m_floor(x);
    return m_select(m_less(f, 1.0f), f, 0.0f); /* -1e-9 would round to 1 */
}

/* x modulo 2 pi in [-pi, pi] (rounded to float). Absolute error < 3e-7 for |x| <= 8192; not for larger x. */
static inline float m_wrap_pi(float x)
{
    float const k = m_round(f_clamp(x, -8192.0f, 8192.0f) * (1.0f / TWO_PI_F));
    float const r = ((x - k * 6.28125f) - k * 1.9350051879882812e-3f) - k * 3.0199159819557529e-7f;
    /* k is one off where the quotient was rounded across a half. */
    float const turn = m_select(m_less(PI_F, r), TWO_PI_F, m_select(m_less(r, -PI_F), -TWO_PI_F, 0.0f));
    return f_clamp(r - turn, -PI_F, PI_F);
}

float m_wrap_pi_one(float x); /* the same, not inlined */

/* Relative error < 1e-7.  Below -87.3 and for NaN: 0; above 88: exp(88). */
static inline float m_exp(float x)
{
    float const y = f_clamp(x, -87.3f, 88.0f);
    float const k = m_round(y * 1.44269504088896341f);
    float const r = (y - k * 0.693359375f) + k * 2.12194440e-4f;
    float p = 1.9875691500e-4f;
    p = p * r + 1.3981999507e-3f;
    p = p * r + 8.3334519073e-3f;
    p = p * r + 4.1665795894e-2f;
    p = p * r + 1.6666665459e-1f;
    p = p * r + 5.0000001201e-1f;
    p = p * (r * r) + r + 1.0f;
    float const scale = m_from_bits((uint32_t)((int32_t)k + 127) << 23); /* k in [-126, 127] */
    return m_select(m_less(-87.3f, x), p * scale, 0.0f);
}

/* Absolute error < 7e-8 (1 + |log x|).  Below FLT_MIN and for NaN: log(FLT_MIN); above FLT_MAX: its log. */
static inline float m_log(float x)
{
    uint32_t const sqrt_half = 0x3f3504f3u;
    uint32_t const u = m_bits(f_clamp(x, FLT_MIN, FLT_MAX)) - sqrt_half + (127u << 23);
    float const e = (float)((int32_t)(u >> 23) - 127);
    /* x = 2^e (1 + f), 1 + f in [0.71, 1.42) */
    float const f = m_from_bits((u & 0x7fffffu) + sqrt_half) - 1.0f;
    float const z = f * f;
    float p = 7.0376836292e-2f;
    p = p * f - 1.1514610310e-1f;
    p = p * f + 1.1676998740e-1f;
    p = p * f - 1.2420140846e-1f;
    p = p * f + 1.4249322787e-1f;
    p = p * f - 1.6668057665e-1f;
    p = p * f + 2.0000714765e-1f;
    p = p * f - 2.4999993993e-1f;
    p = p * f + 3.3333331174e-1f;
    float const y = (p * f * z - e * 2.12194440e-4f) - 0.5f * z;
    return (f + y) + e * 0.693359375f;
}

/* Absolute error < 1e-7 for |x| <= 8192; beyond, and for NaN, some value in [-1, 1]. f_clamp is not used
 * here: where x comes from memory the compiler makes branches of it and does not vectorise the loop. */
static inline void m_sincos(float x, float *s, float *c)
{
    float const y = m_select(m_less(fabsf(x), 8193.0f), x, 0.0f);
    float const k = m_round(y * (2.0f / PI_F));
    float const r = ((y - k * 1.5703125f) - k * 4.837512969970703125e-4f) - k * 7.54978995489188216e-8f;
    float const z = r * r;
    float const sn = ((-1.9515295891e-4f * z + 8.3321608736e-3f) * z - 1.6666654611e-1f) * z * r + r;
    float const cp = (2.443315711809948e-5f * z - 1.388731625493765e-3f) * z + 4.166664568298827e-2f;
    float const cs = cp * (z * z) - 0.5f * z + 1.0f;
    uint32_t const q = (uint32_t)(int32_t)k; /* quadrant, modulo 4 */
    uint32_t const swap = 0u - (q & 1u);
    *s = m_from_bits(m_bits(m_select(swap, cs, sn)) ^ ((q & 2u) << 30));
    *c = m_from_bits(m_bits(m_select(swap, sn, cs)) ^ (((q + 1u) & 2u) << 30));
}

void m_sincos_one(float x, float *s, float *c); /* the same, not inlined */

/* Absolute error < 3e-7; in [-pi, pi]; 0 for y = x = 0.  Arguments finite and below 1e37. */
float m_atan2(float y, float x);

/* Absolute error < 2e-7; arguments outside [-1, 1] are clamped. */
static inline float m_asin(float x)
{
    float const a = f_min(fabsf(x), 1.0f);
    uint32_t const fold = m_less(0.5f, a); /* asin a = pi/2 - 2 asin sqrt((1 - a)/2) */
    float const z = m_select(fold, 0.5f * (1.0f - a), a * a);
    float const t = m_select(fold, sqrtf(z), a);
    float p = (4.2163199048e-2f * z + 2.4181311049e-2f) * z + 4.5470025998e-2f;
    p = ((p * z + 7.4953002686e-2f) * z + 1.6666752422e-1f) * z * t + t;
    return m_from_bits(m_bits(m_select(fold, 0.5f * PI_F - 2.0f * p, p)) | (m_bits(x) & 0x80000000u));
}

/* Relative error < 4e-16.  Below -708 and for NaN: 0; above 709: exp(709). */
double m_exp64(double x);
void m_exp64_all(const double *x, int32_t n, double *out);

/* Relative error < 4e-16.  Below DBL_MIN and for NaN: log(DBL_MIN); above DBL_MAX: its log. */
double m_log64(double x);

/* Absolute error < 3e-16 for |x| < 1000; NaN for numbers that are not finite. */
void m_sincos64(double x, double *s, double *c);
/* The median of count > 0 numbers, the upper one of two; their order changes. */
double m_median(double *x, int32_t count);

#endif
