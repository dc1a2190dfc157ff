/* Instruction sets by what a CPU and its operating system report. */
#include "base/cpu.h"

#include "check.h"

#if defined(__x86_64__)
#include <cpuid.h>

enum {
    SSE4_1C = bit_SSSE3 | bit_SSE4_1 | bit_POPCNT,
    AVX2_1C = SSE4_1C | bit_AVX,
    AVX2_7B = bit_AVX2 | bit_BMI | bit_BMI2,
    AVX_STATE = 0x7,
    AVX512_STATE = 0xe7
};
static const uint32_t AVX512_7B = AVX2_7B | bit_AVX512F | bit_AVX512BW | bit_AVX512DQ | bit_AVX512VL,
                      AVX512_7C = bit_AVX512VBMI | bit_AVX512VPOPCNTDQ | bit_AVX512BITALG;
static const uint32_t SSE4 = GAIT_CPU_BASE | GAIT_CPU_SSE4, AVX2 = SSE4 | GAIT_CPU_AVX2,
                      AVX512 = AVX2 | GAIT_CPU_AVX512;

static void test_features(void)
{
    CHECK(cpu_features_of(0, 0, 0, 0) == GAIT_CPU_BASE);
    CHECK(cpu_features_of(SSE4_1C, 0, 0, 0) == SSE4);
    CHECK(cpu_features_of(AVX2_1C, AVX2_7B, 0, AVX_STATE) == AVX2);
    CHECK(cpu_features_of(AVX2_1C, AVX512_7B, AVX512_7C, AVX512_STATE) == AVX512);
    CHECK(cpu_features_of(AVX2_1C, AVX512_7B, AVX512_7C, AVX_STATE) ==
          AVX2); /* a system that saves no more */
    CHECK(cpu_features_of(AVX2_1C, AVX512_7B, AVX512_7C, 0) == SSE4);
    CHECK(cpu_features_of(~0u, ~0u, ~0u, ~0u) == AVX512);
    CHECK((cpu_features() & ~AVX512) == 0 && (cpu_features() & GAIT_CPU_BASE));
}

/* Every instruction that a set needs has to be there. */
static void test_each_bit(void)
{
    for (uint32_t bit = 1; bit; bit <<= 1) {
        if (bit & SSE4_1C)
            CHECK(cpu_features_of(SSE4_1C & ~bit, 0, 0, 0) == GAIT_CPU_BASE);
        if (bit & (bit_AVX | bit_POPCNT))
            CHECK(!(cpu_features_of(AVX2_1C & ~bit, AVX2_7B, 0, AVX_STATE) & GAIT_CPU_AVX2));
        if (bit & AVX2_7B)
            CHECK(cpu_features_of(AVX2_1C, AVX512_7B & ~bit, AVX512_7C, AVX512_STATE) == SSE4);
        if (bit & AVX512_7B & ~(uint32_t)AVX2_7B)
            CHECK(cpu_features_of(AVX2_1C, AVX512_7B & ~bit, AVX512_7C, AVX512_STATE) == AVX2);
        if (bit & AVX512_7C)
            CHECK(cpu_features_of(AVX2_1C, AVX512_7B, AVX512_7C & ~bit, AVX512_STATE) == AVX2);
        if (bit & 0xe0)
            CHECK(cpu_features_of(AVX2_1C, AVX512_7B, AVX512_7C, AVX512_STATE & ~bit) == AVX2);
    }
}
#endif

static void test_mask(void)
{
    CHECK(cpu_mask_valid(0) && cpu_mask_valid(~0u) && cpu_mask_valid(GAIT_CPU_BASE | GAIT_CPU_AVX512));
    CHECK(!cpu_mask_valid(16) && !cpu_mask_valid(~1u));
}

int main(void)
{
#if defined(__x86_64__)
    test_features();
    test_each_bit();
#endif
    test_mask();
    return CHECK_DONE();
}
