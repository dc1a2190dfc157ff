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

uint32_t cpu_features_of(uint32_t c1, uint32_t b7, uint32_t c7, uint32_t state)
{
    uint32_t const sse4_1c = bit_SSSE3 | bit_SSE4_1 | bit_POPCNT;
    uint32_t const avx2_1c = bit_AVX | bit_POPCNT, avx2_7b = bit_AVX2 | bit_BMI | bit_BMI2, avx_state = 0x6;
    uint32_t const avx512_7b = bit_AVX512F | bit_AVX512BW | bit_AVX512DQ | bit_AVX512VL, avx512_state = 0xe6;
    uint32_t const avx512_7c = bit_AVX512VBMI | bit_AVX512VPOPCNTDQ | bit_AVX512BITALG;
    uint32_t features = GAIT_CPU_BASE;
    if (has(c1, sse4_1c))
        features |= GAIT_CPU_SSE4;
    if (!has(c1, avx2_1c) || !has(b7, avx2_7b) || !has(state, avx_state))
        return features;
    features |= GAIT_CPU_AVX2;
    if (has(b7, avx512_7b) && has(c7, avx512_7c) && has(state, avx512_state))
        features |= GAIT_CPU_AVX512;
    return features;
}

uint32_t cpu_features(void)
{
    uint32_t a, b, c1 = 0, d, b7 = 0, c7 = 0; /* a CPU without one of the leaves leaves its bits at 0 */
    (void)__get_cpuid(1, &a, &b, &c1, &d);
    (void)__get_cpuid_count(7, 0, &a, &b7, &c7, &d);
    return cpu_features_of(c1, b7, c7, has(c1, bit_OSXSAVE) ? saved_state() : 0);
}
#else
uint32_t cpu_features(void)
{
    return GAIT_CPU_BASE;
}
#endif
