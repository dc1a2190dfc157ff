#include "raster/layers.h"

int32_t layers_order(const float *depth, int32_t stride, int32_t limbs, int32_t *order)
{
    int32_t n = 0;
    for (int32_t l = 0; l < limbs; l++) {
        float const d = depth[l * stride];
        if (!(d > 0.0f))
            continue;
        int32_t k = n++;
        for (; k > 0 && depth[order[k - 1] * stride] > d; k--)
            order[k] = order[k - 1];
        order[k] = l;
    }
    return n;
}
