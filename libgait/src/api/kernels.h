/* kernels.h - choice of the instruction set that an object's kernels use. */
#ifndef GAIT_API_KERNELS_H
#define GAIT_API_KERNELS_H
#include "base/dispatch.h"

/* The best of the instruction sets in the mask (GAIT_CPU_*) that this CPU supports; mask 0: scalar. */
const kernels *kernels_choose(uint32_t mask);
#endif
