/* Particles as likely as somebody who is hidden at the least. */
#include "fmath.h"
#include "kernels.h"

void KERNEL(loss_join)(const float *restrict a, float b, int32_t n, float *restrict out)
{
    for (int32_t i = 0; i < n; i++) {
        float const more = f_max(a[i], b), less = f_min(a[i], b);
        out[i] = more + m_log(1.0f + m_exp(less - more));
    }
}
