/* wide.h - for kernels, as many doubles as a register of the instruction set holds. */
#ifndef GAIT_WIDE_H
#define GAIT_WIDE_H
#include <stdint.h>
#include <string.h>
#if defined(__AVX512F__)
#include <immintrin.h>
#endif

/* Anywhere in memory, beside plain numbers. */
#define WIDE_OF(T, bytes) typedef T __attribute__((vector_size(bytes), aligned(sizeof(T)), may_alias))

#if defined(KERNEL_SCALAR)
typedef double wide;
typedef float wide_half, wide_float;
#define WIDEN(x)  ((double)(x))
#define NARROW(x) ((float)(x))
#else
#if defined(__AVX512F__)
#define WIDE_BYTES 64
#elif defined(__AVX2__)
#define WIDE_BYTES 32
#else
#define WIDE_BYTES 16
#endif
WIDE_OF(double, WIDE_BYTES) wide;
WIDE_OF(float, WIDE_BYTES / 2) wide_half;
WIDE_OF(float, WIDE_BYTES) wide_float;
#if defined(__AVX512F__)
#define WIDEN(x)  ((wide)_mm512_cvtps_pd((__m256)(x))) /* gcc converts halves */
#define NARROW(x) ((wide_half)_mm512_cvtpd_ps((__m512d)(x)))
#else
#define WIDEN(x)  __builtin_convertvector(x, wide)
#define NARROW(x) __builtin_convertvector(x, wide_half)
#endif
#endif

enum { WIDE = (int32_t)(sizeof(wide) / sizeof(double)) };

static inline wide wide_load(const double *from)
{
    return *(const wide *)(const void *)from;
}

static inline wide wide_load_float(const float *from)
{
    return WIDEN(*(const wide_half *)(const void *)from);
}

static inline void wide_store(double *to, wide x)
{
    *(wide *)(void *)to = x;
}

static inline void wide_store_float(float *to, wide x)
{
    *(wide_half *)(void *)to = NARROW(x);
}
#endif
