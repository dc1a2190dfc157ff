#include "base/grid_mask.h"

#define FROM(k) ~UINT64_C(0) << (k)
#define EIGHT(k)                                                                                             \
    FROM(k), FROM(k + 1), FROM(k + 2), FROM(k + 3), FROM(k + 4), FROM(k + 5), FROM(k + 6), FROM(k + 7)
const uint64_t grid_from[65] = {EIGHT(0),  EIGHT(8),  EIGHT(16), EIGHT(24), EIGHT(32),
                                EIGHT(40), EIGHT(48), EIGHT(56), 0};
