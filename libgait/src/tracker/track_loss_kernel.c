/* Log of the sum of two likelihoods: of a particle as visible and of a hidden person. */
#include "base/dispatch.h"
#include "base/fmath.h"
#include <string.h>

enum { CHUNK = 64 }; /* particles at once, so that the vectorised loop needs no remainder */

/* hidden: less `base` on entry, the log of the sum on return. */
KERNEL_ROW void join(const float *restrict visible, float base, float *restrict hidden)
{
    for (int32_t i = 0; i < CHUNK; i++) {
        float const other = base + hidden[i];
        float const more = f_max(visible[i], other), less = f_min(visible[i], other);
        hidden[i] = more + m_log(1.0f + m_exp(less - more));
    }
}

void KERNEL(track_loss_join)(const float *visible, float base, int32_t n, float *hidden)
{
    int32_t const whole = n - n % CHUNK;
    size_t const rest = (size_t)(n - whole) * sizeof *hidden;
    float end[2][CHUNK] = {{0.0f}};
    for (int32_t i = 0; i < whole; i += CHUNK)
        join(visible + i, base, hidden + i);
    memcpy(end[0], visible + whole, rest);
    memcpy(end[1], hidden + whole, rest);
    join(end[0], base, end[1]);
    memcpy(hidden + whole, end[1], rest);
}
