/* cpu.h - what this CPU can do. */
#ifndef GAIT_BASE_CPU_H
#define GAIT_BASE_CPU_H
#include "base/base.h"

/* GAIT_CPU_* bits that this CPU and its operating system support, for the instruction sets of this build. */
uint32_t cpu_features(void);

/* A config's cpu_mask: all bits, or only those of GAIT_CPU_*. */
bool cpu_mask_valid(uint32_t mask);
#endif
