/* Particles as likely as somebody who is hidden at the least, but for the parts that are seen. */
#include "base/fmath.h"
#include "base/dispatch.h"
#include <string.h>

enum { SIMD16 = 64 }; /* as many at once, so that the loop needs no remainder */

KERNEL_ROW void join(const float *restrict a, float b, float *restrict part)
{
    for (int32_t i = 0; i < SIMD16; i++) {
        float const hidden = b + part[i];
        float const more = f_max(a[i], hidden), less = f_min(a[i], hidden);
        part[i] = more + m_log(1.0f + m_exp(less - more));
    }
}

void KERNEL(track_loss_join)(const float *a, float b, int32_t n, float *part)
{
    int32_t const whole = n - n % SIMD16;
    float end[2][SIMD16] = {{0.0f}};
    for (int32_t i = 0; i < whole; i += SIMD16)
        join(a + i, b, part + i);
    memcpy(end[0], a + whole, (size_t)(n - whole) * sizeof *a);
    memcpy(end[1], part + whole, (size_t)(n - whole) * sizeof *part);
    join(end[0], b, end[1]);
    memcpy(part + whole, end[1], (size_t)(n - whole) * sizeof *part);
}
