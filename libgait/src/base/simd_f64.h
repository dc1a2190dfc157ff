/* simd_f64.h - for kernels: as many doubles as a register of the instruction set has. */
#ifndef GAIT_BASE_SIMD_F64_H
#define GAIT_BASE_SIMD_F64_H
#include <stdint.h>
#include <string.h>
#if defined(__AVX512F__)
#include <immintrin.h>
#endif

/* May be loaded from any address that is aligned to T. */
#define SIMD_F64_OF(T, bytes) typedef T __attribute__((vector_size(bytes), aligned(sizeof(T)), may_alias))

#if defined(KERNEL_SCALAR)
typedef double simd_f64;
typedef float simd_f64_half, simd_f64_float;
#define SIMD_F64_WIDEN(x)  ((double)(x))
#define SIMD_F64_NARROW(x) ((float)(x))
#else
#if defined(__AVX512F__)
#define SIMD_F64_BYTES 64
#elif defined(__AVX2__)
#define SIMD_F64_BYTES 32
#else
#define SIMD_F64_BYTES 16
#endif
SIMD_F64_OF(double, SIMD_F64_BYTES) simd_f64;
SIMD_F64_OF(float, SIMD_F64_BYTES / 2) simd_f64_half;
SIMD_F64_OF(float, SIMD_F64_BYTES) simd_f64_float;
#if defined(__AVX512F__)
#define SIMD_F64_WIDEN(x)  ((simd_f64)_mm512_cvtps_pd((__m256)(x))) /* gcc converts halves */
#define SIMD_F64_NARROW(x) ((simd_f64_half)_mm512_cvtpd_ps((__m512d)(x)))
#else
#define SIMD_F64_WIDEN(x)  __builtin_convertvector(x, simd_f64)
#define SIMD_F64_NARROW(x) __builtin_convertvector(x, simd_f64_half)
#endif
#endif

enum { SIMD_F64 = (int32_t)(sizeof(simd_f64) / sizeof(double)) };

static inline simd_f64 simd_f64_load(const double *from)
{
    return *(const simd_f64 *)(const void *)from;
}

static inline simd_f64 simd_f64_load_float(const float *from)
{
    return SIMD_F64_WIDEN(*(const simd_f64_half *)(const void *)from);
}

static inline void simd_f64_store(double *to, simd_f64 x)
{
    *(simd_f64 *)(void *)to = x;
}

static inline void simd_f64_store_float(float *to, simd_f64 x)
{
    *(simd_f64_half *)(void *)to = SIMD_F64_NARROW(x);
}
#endif
