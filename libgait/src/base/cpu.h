/* cpu.h - instruction sets that this CPU supports. */
#ifndef GAIT_BASE_CPU_H
#define GAIT_BASE_CPU_H
#include "base/base.h"

/* GAIT_CPU_* bits that this CPU and its operating system support, for the instruction sets of this build. */
uint32_t cpu_features(void);

/* True if a config's cpu_mask has all bits set, or only those of GAIT_CPU_*. */
bool cpu_mask_valid(uint32_t mask);
#endif
