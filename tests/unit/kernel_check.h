/* kernel_check.h - the kernels of every instruction set that this CPU has, against the scalar definition.
 *
 *   for (int k = 0; k < isa_count(); k++)
 *       compare(isa_scalar(), isa_at(k));
 *
 * Outputs lie between canaries: guard_fill(&g) before the call, CHECK(guard_whole(&g)) after it. */
#ifndef KERNEL_CHECK_H
#define KERNEL_CHECK_H
#include "api/kernels.h"

#include <stdint.h>
#include <string.h>

static inline const kernels *isa_scalar(void)
{
    return kernels_choose(0);
}

/* Number of instruction sets besides the scalar one. */
static inline int isa_count(void)
{
    int n = 0;
    for (uint32_t bits = gait_cpu_features(); bits; bits >>= 1)
        n += (int)(bits & 1u);
    return n;
}

static inline const kernels *isa_at(int k)
{
    uint32_t bits = gait_cpu_features();
    for (; k > 0; k--)
        bits &= bits - 1;
    return kernels_choose(bits & -bits);
}

enum { GUARD = 64 }; /* bytes on each side */

typedef struct guarded { /* memory between canaries */
    unsigned char *begin;
    size_t bytes; /* without the canaries */
} guarded;

/* memory has bytes + 2 GUARD bytes, all of which are set to the canary. */
static inline guarded guard_fill(unsigned char *memory, size_t bytes)
{
    memset(memory, 0xa5, bytes + 2 * GUARD);
    return (guarded){memory + GUARD, bytes};
}

static inline int guard_whole(const guarded *g)
{
    int damaged = 0;
    for (size_t i = 0; i < GUARD; i++)
        damaged += g->begin[g->bytes + i] != 0xa5 || (g->begin - GUARD)[i] != 0xa5;
    return damaged == 0;
}
#endif
