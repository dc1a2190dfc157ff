/* Sweeps against double libm; the bounds are the ones that fmath.h states. */
#include "base/fmath.h"

#include "check.h"

typedef struct sweep {
    double worst; /* largest error met */
    double at;    /* where */
} sweep;

static void meet(sweep *s, double error, double at)
{
    if (!(error <= s->worst)) {
        s->worst = error;
        s->at = at;
    }
}

/* The worst error must be below the bound, but not far below: otherwise the sweep misses something or the bound is too
 * weak. */
static void settle(const char *what, sweep s, double bound)
{
    if (!(s.worst < bound && s.worst > bound / 3.0))
        fprintf(stderr, "%s: error %.3g at %.9g, stated %.3g\n", what, s.worst, s.at, bound);
    CHECK(s.worst < bound && s.worst > bound / 3.0);
}

/* Distance of a and b around the circle. */
static double circular(double a, double b)
{
    return fabs(remainder(a - b, 2.0 * 3.14159265358979323846));
}

static void test_exp_log(void)
{
    sweep e = {0}, l = {0};
    for (double x = -87.29; x < 88.0; x += 0.00037) {
        float const f = (float)x;
        meet(&e, fabs((double)m_exp(f) / exp((double)f) - 1.0), (double)f);
    }
    for (uint32_t u = 0x00800000u; u < 0x7f800000u; u += 1999u) {
        double const x = (double)m_from_bits(u);
        meet(&l, fabs((double)m_log((float)x) - log(x)) / (1.0 + fabs(log(x))), x);
    }
    for (double x = 0.6; x < 1.7; x += 1e-5)
        meet(&l, fabs((double)m_log((float)x) - log((double)(float)x)) / (1.0 + fabs(log(x))), x);
    settle("exp", e, 1e-7);
    settle("log", l, 7e-8);
}

static void test_sincos(void)
{
    sweep both = {0};
    for (double x = -8192.0; x <= 8192.0; x += fabs(x) < 100.0 ? 0.00031 : 0.0173) {
        float s, c;
        double const f = (double)(float)x;
        m_sincos((float)x, &s, &c);
        meet(&both, fmax(fabs((double)s - sin(f)), fabs((double)c - cos(f))), f);
    }
    settle("sincos", both, 1e-7);
}

static void test_inverse(void)
{
    sweep a = {0}, s = {0};
    for (double t = -3.1415; t < 3.1416; t += 0.00007)
        for (double r = 1e-6; r < 1e7; r *= 97.0) {
            float const x = (float)(r * cos(t)), y = (float)(r * sin(t));
            meet(&a, circular((double)m_atan2(y, x), atan2((double)y, (double)x)), t);
        }
    for (double x = -1.0; x <= 1.0; x += 1.3e-5)
        meet(&s, fabs((double)m_asin((float)x) - asin((double)(float)x)), x);
    settle("atan2", a, 3e-7);
    settle("asin", s, 2e-7);
    CHECK(m_asin(1.0f) == 0.5f * PI_F && m_asin(-1.0f) == -0.5f * PI_F && m_asin(0.0f) == 0.0f);
    CHECK(m_atan2(0.0f, 0.0f) == 0.0f);
    CHECK(m_atan2(0.0f, -1.0f) == PI_F && m_atan2(-0.0f, -1.0f) == -PI_F);
    CHECK(m_atan2(1.0f, 0.0f) == 0.5f * PI_F && m_atan2(-1.0f, 0.0f) == -0.5f * PI_F);
}

static void test_wrap(void)
{
    sweep w = {0};
    for (double x = -8192.0; x <= 8192.0; x += 0.0131) {
        float const y = m_wrap_pi((float)x);
        meet(&w, circular((double)y, (double)(float)x), x);
        if (!(fabsf(y) <= PI_F))
            check_that(0, "m_wrap_pi stays in [-pi, pi]", __FILE__, __LINE__);
    }
    settle("wrap_pi", w, 3e-7);
    for (double x = -40.0; x < 40.0; x += 0.0071) {
        float const f = (float)x, y = m_wrap1(f);
        if (!(y >= 0.0f && y < 1.0f && fabs((double)y - ((double)f - floor((double)f))) < 6e-8))
            CHECK_NEAR(y, (double)f - floor((double)f), 6e-8);
    }
    CHECK(m_wrap1(-1e-9f) == 0.0f && m_wrap1(1.0f) == 0.0f);
    CHECK(m_wrap1(-0.25f) == 0.75f && m_wrap1(-3.0f) == 0.0f);
}

static void test_floor(void)
{
    static const float x[] = {0.0f,  0.5f,  -0.5f,   0.99999994f, -1e-30f,     1e-30f,
                              -1.0f, 8.0f,  -8.5f,   8388607.5f,  8388608.0f,  -8388607.5f,
                              3e9f,  -3e9f, FLT_MAX, -FLT_MAX,    16777216.0f, -8388608.0f};
    for (size_t i = 0; i < sizeof x / sizeof *x; i++)
        CHECK(m_floor(x[i]) == floorf(x[i]));
    for (double t = -5.0; t < 5.0; t += 0.01)
        CHECK(m_floor((float)t) == floorf((float)t) && m_round((float)t) == rintf((float)t));
}

/* The numbers of a broken particle must give defined results. */
static void test_extremes(void)
{
    float const inf = HUGE_VALF, nan = nanf("");
    float const large[] = {1e9f, -1e9f, FLT_MAX, inf, nan};
    CHECK(m_exp(-87.4f) == 0.0f && m_exp(-inf) == 0.0f && m_exp(nan) == 0.0f);
    CHECK(m_exp(inf) == m_exp(88.0f) && m_exp(0.0f) == 1.0f);
    CHECK(m_log(0.0f) == m_log(FLT_MIN) && m_log(-1.0f) == m_log(FLT_MIN) && m_log(nan) == m_log(FLT_MIN));
    CHECK(m_log(inf) == m_log(FLT_MAX) && m_log(1.0f) == 0.0f);
    for (int i = 0; i < 5; i++) {
        float s = 2.0f, c = 2.0f;
        m_sincos(large[i], &s, &c);
        CHECK(fabsf(s) <= 1.0f && fabsf(c) <= 1.0f);
    }
    CHECK(m_wrap1(nan) == 0.0f && m_wrap1(3e9f) == 0.0f && isnan(m_floor(nan)));
    CHECK(m_asin(2.0f) == 0.5f * PI_F && m_asin(-7.0f) == -0.5f * PI_F);
}

static void test_double(void)
{
    sweep e = {0}, l = {0};
    for (double x = -707.9; x < 709.0; x += 0.00713)
        meet(&e, fabs(m_exp64(x) / exp(x) - 1.0), x);
    for (double x = 1e-300; x < 1e300; x *= 1.00713)
        if (fabs(x - 1.0) > 1e-3)
            meet(&l, fabs(m_log64(x) / log(x) - 1.0), x);
    for (double x = 0.5; x < 2.0; x += 1.37e-5)
        if (x != 1.0)
            meet(&l, fabs(m_log64(x) / log(x) - 1.0), x);
    settle("exp64", e, 4e-16);
    settle("log64", l, 4e-16);
    CHECK(m_exp64(0.0) == 1.0 && m_exp64(-709.0) == 0.0 && m_exp64((double)nanf("")) == 0.0);
    CHECK(m_exp64(1e9) == m_exp64(709.0) && m_log64(1.0) == 0.0);
    CHECK(m_log64(0.0) == m_log64(DBL_MIN) && m_log64(-3.0) == m_log64(DBL_MIN));
    CHECK(m_log64((double)nanf("")) == m_log64(DBL_MIN) && m_log64(HUGE_VAL) == m_log64(DBL_MAX));
}

#define FMATH_BITS UINT64_C(0x22491f4501f0df71)

/* The bits themselves: a compiler or CPU that rounds otherwise changes this sum. */
static void test_bits(void)
{
    uint64_t h = 0;
    for (int i = -2000; i <= 2000; i++) {
        float const x = (float)i * 0.0371f;
        float s, c;
        m_sincos(x, &s, &c);
        float const y[] = {m_exp(x), m_log(fabsf(x)), s, c, m_atan2(x, 1.3f - x), m_asin(x / 75.0f)};
        for (int k = 0; k < 6; k++)
            h = (h ^ m_bits(y[k])) * UINT64_C(0x100000001b3);
        double const z[] = {m_exp64((double)x), m_log64(1.0 + (double)fabsf(x))};
        for (int k = 0; k < 2; k++) {
            uint64_t u;
            memcpy(&u, &z[k], sizeof u);
            h = (h ^ u) * UINT64_C(0x100000001b3);
        }
    }
    if (h != FMATH_BITS)
        fprintf(stderr, "bits of fmath: 0x%016llx\n", (unsigned long long)h);
    CHECK(h == FMATH_BITS);
}

static void test_sincos64(void)
{
    double worst = 0.0, s, c;
    for (int i = -40000; i <= 40000; i++) {
        double const x = 0.0237 * i;
        m_sincos64(x, &s, &c);
        worst = fmax(worst, fmax(fabs(s - sin(x)), fabs(c - cos(x))));
    }
    CHECK_NEAR(worst, 0.0, 3e-16);
    m_sincos64(NAN, &s, &c);
    CHECK(isnan(s) && isnan(c));
}

int main(void)
{
    test_sincos64();
    test_exp_log();
    test_sincos();
    test_inverse();
    test_wrap();
    test_floor();
    test_extremes();
    test_double();
    test_bits();
    return CHECK_DONE();
}
