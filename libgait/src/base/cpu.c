#include "base/cpu.h"

bool cpu_mask_valid(uint32_t mask)
{
    return mask == ~0u || (mask & ~(GAIT_CPU_BASE | GAIT_CPU_SSE4 | GAIT_CPU_AVX2 | GAIT_CPU_AVX512)) == 0;
}

#if defined(__x86_64__)
#include <cpuid.h>

/* Register state that the operating system saves: bit 1 SSE, bit 2 AVX, bits 5 to 7 AVX-512. */
static uint32_t saved_state(void)
{
    uint32_t low, high;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return low;
}

static bool has(uint32_t bits, uint32_t wanted)
{
    return (bits & wanted) == wanted;
}

uint32_t cpu_features(void)
{
    uint32_t const avx_state = 0x6, avx512_state = 0xe6;
    uint32_t const sse4_1c = bit_SSSE3 | bit_SSE4_1 | bit_POPCNT;
    uint32_t const avx2_1c = bit_OSXSAVE | bit_AVX | bit_POPCNT, avx2_7b = bit_AVX2 | bit_BMI | bit_BMI2;
    uint32_t const avx512_7b = bit_AVX512F | bit_AVX512BW | bit_AVX512DQ | bit_AVX512VL;
    uint32_t const avx512_7c = bit_AVX512VBMI | bit_AVX512VPOPCNTDQ | bit_AVX512BITALG;
    uint32_t a, b1, c1, d, b7, c7, features = GAIT_CPU_BASE;
    if (!__get_cpuid(1, &a, &b1, &c1, &d))
        return features;
    features |= has(c1, sse4_1c) ? GAIT_CPU_SSE4 : 0;
    if (!__get_cpuid_count(7, 0, &a, &b7, &c7, &d))
        return features;
    if (!has(c1, avx2_1c) || !has(b7, avx2_7b) || !has(saved_state(), avx_state))
        return features;
    features |= GAIT_CPU_AVX2;
    if (has(b7, avx512_7b) && has(c7, avx512_7c) && has(saved_state(), avx512_state))
        features |= GAIT_CPU_AVX512;
    return features;
}
#else
uint32_t cpu_features(void)
{
    return GAIT_CPU_BASE;
}
#endif
