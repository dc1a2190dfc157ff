/* kernels.c - the kernels of each instruction set: the only file that names them all. */
#include "api/kernels.h"
#include "base/cpu.h"

/* Declarations of the kernels of every ISA, and one constant table of each. */
#define DECLARE_scalar(result, name, parameters) result name##_scalar parameters;
#define DECLARE_base(result, name, parameters)   result name##_base parameters;
#define DECLARE_sse4(result, name, parameters)   result name##_sse4 parameters;
#define DECLARE_avx2(result, name, parameters)   result name##_avx2 parameters;
#define DECLARE_avx512(result, name, parameters) result name##_avx512 parameters;
#define MEMBER_scalar(result, name, parameters)  .name = name##_scalar,
#define MEMBER_base(result, name, parameters)    .name = name##_base,
#define MEMBER_sse4(result, name, parameters)    .name = name##_sse4,
#define MEMBER_avx2(result, name, parameters)    .name = name##_avx2,
#define MEMBER_avx512(result, name, parameters)  .name = name##_avx512,
#define AVX_scalar                               MEMBER_scalar
#define AVX_base                                 MEMBER_base
#define AVX_sse4                                 MEMBER_base
#define AVX_avx2                                 MEMBER_avx2
#define AVX_avx512                               MEMBER_avx512
#define FRAME_scalar                             MEMBER_scalar
#define FRAME_base                               MEMBER_base
#define FRAME_sse4                               MEMBER_base
#define FRAME_avx2                               MEMBER_avx2
#define FRAME_avx512                             MEMBER_avx2
#define TABLE(which, bit)                                                                                    \
    KERNELS(DECLARE_##which)                                                                                 \
    static const kernels which = {                                                                           \
        .isa = #which, KERNELS_EACH(MEMBER_##which) KERNELS_AVX(AVX_##which) KERNELS_FRAME(FRAME_##which)};
KERNEL_ISAS(TABLE)

const kernels *kernels_choose(uint32_t mask)
{
    uint32_t const usable = mask & cpu_features();
    const kernels *best = &scalar;
#define CONSIDER(which, bit) best = (usable & (bit)) ? &which : best;
    KERNEL_ISAS(CONSIDER)
#undef CONSIDER
    return best;
}
