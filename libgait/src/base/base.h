/* base.h - what every file may use: assertions, min/max, constants, error reporting. */
#ifndef GAIT_BASE_BASE_H
#define GAIT_BASE_BASE_H
#include "gait.h"

#include <assert.h>
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

/* Checks that cost nothing in a release build. Arguments from outside are checked in api/ instead. */
#ifdef NDEBUG
#define GAIT_ASSERT(x) ((void)0)
#else
#define GAIT_ASSERT(x) assert(x)
#endif

/* Compiles a function for size, in a file that is compiled for speed: it is called at most a few times a frame. */
#ifdef __GNUC__
#define COLD __attribute__((cold))
#else
#define COLD
#endif

#define PI_F     3.14159265358979323846f
#define TWO_PI_F 6.28318530717958647692f

_Static_assert(CHAR_BIT == 8 && sizeof(float) == 4 && sizeof(double) == 8, "IEEE 754 binary32 and binary64");
_Static_assert(FLT_RADIX == 2 && FLT_MANT_DIG == 24 && DBL_MANT_DIG == 53, "IEEE 754 binary32 and binary64");
_Static_assert(FLT_EVAL_METHOD == 0, "excess precision breaks determinism");

/* Branch-free in a loop over lanes. If the first argument is NaN the result is the second. */
#if defined(__aarch64__) && defined(KERNEL_ISA) && !defined(__clang__)
/* In a loop over lanes gcc makes ten instructions of a choice between floats, two of one between words. */
static inline float f_choose(bool take, float a, float b)
{
    uint32_t x, y, mask = 0u - (uint32_t)take;
    memcpy(&x, &a, sizeof x);
    memcpy(&y, &b, sizeof y);
    x = (x & mask) | (y & ~mask);
    memcpy(&a, &x, sizeof a);
    return a;
}
#else
static inline float f_choose(bool take, float a, float b)
{
    return take ? a : b;
}
#endif

/* Whether b is known to be a number other than 0. Then fminf and fmaxf, each an instruction of aarch64, give the same. */
#if defined(__aarch64__) && defined(__GNUC__)
#define F_KNOWN(b) (__builtin_constant_p(b) && ((b) < 0.0f || (b) > 0.0f))
#else
#define F_KNOWN(b) false
#endif

static inline float f_min(float a, float b)
{
    return F_KNOWN(b) ? __builtin_fminf(a, b) : f_choose(a < b, a, b);
}

static inline float f_max(float a, float b)
{
    return F_KNOWN(b) ? __builtin_fmaxf(a, b) : f_choose(a > b, a, b);
}

/* A bound that is used in a loop over lanes, prepared before it. For x86 gcc makes one instruction of a minimum only if
 * it does not know the bound, and else compares and selects. */
static inline float f_bound(float x)
{
#if defined(__GNUC__) && !defined(__clang__) && defined(__SSE2__)
    __asm__("" : "+x"(x));
#endif
    return x;
}

/* NaN gives lo, so that a clamped value is always safe to convert to an integer. */
static inline float f_clamp(float x, float lo, float hi)
{
    return f_min(f_max(x, lo), hi);
}

static inline int32_t i_min(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static inline int32_t i_max(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

static inline int32_t i_clamp(int32_t x, int32_t lo, int32_t hi)
{
    return i_min(i_max(x, lo), hi);
}

/* True if all n floats are finite. */
static inline bool f_finite(const float *x, size_t n)
{
    bool ok = true;
    for (size_t i = 0; i < n; i++)
        ok &= fabsf(x[i]) <= FLT_MAX;
    return ok;
}

/* Fill err (may be NULL) with the result code, an index and one formatted line. Returns s. */
#if defined(__GNUC__)
__attribute__((format(printf, 4, 5)))
#endif
gait_result base_fail(gait_error *err, gait_result s, int index, const char *fmt, ...);
/* GAIT_ERR_ARG: a pointer that the function needs is NULL. */
gait_result base_null(gait_error *err, const char *function);
#endif
