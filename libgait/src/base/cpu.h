/* cpu.h - instruction sets that this CPU supports. */
#ifndef GAIT_BASE_CPU_H
#define GAIT_BASE_CPU_H
#include "base/base.h"

/* GAIT_CPU_* bits that this CPU and its operating system support, for the instruction sets of this build. */
uint32_t cpu_features(void);

/* True if a config's cpu_mask has all bits set, or only those of GAIT_CPU_*. */
bool cpu_mask_valid(uint32_t mask);
#if defined(__x86_64__)
/* The same by what the CPU reports in ecx of leaf 1 and in ebx and ecx of leaf 7, and by the register state that the
 * operating system saves, 0 if it saves none. */
uint32_t cpu_features_of(uint32_t c1, uint32_t b7, uint32_t c7, uint32_t state);
#endif
#endif
