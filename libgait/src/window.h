/* window.h - sums over a sliding window of a row of the working image, replicated at its ends. */
#ifndef GAIT_WINDOW_H
#define GAIT_WINDOW_H
#include "view.h"

/* The row with `radius` more on each side. */
#define WINDOW_WIDTH(radius) (VIEW_SIZE + 2 * (radius))

/* Replicate the first and last of the VIEW_SIZE values that begin at wide[radius]. */
static inline void window_ends(int32_t *wide, int32_t radius)
{
    for (int32_t i = 0; i < radius; i++) {
        wide[i] = wide[radius];
        wide[radius + VIEW_SIZE + i] = wide[radius + VIEW_SIZE - 1];
    }
}

/* Sums of eight neighbours, of which the sums of longer windows are made: out[i] = wide[i] + ... + wide[i + 7]. */
static inline void window_eight(const int32_t *wide, int32_t radius, int32_t *restrict out)
{
    for (int32_t i = 0; i < WINDOW_WIDTH(radius) - 7; i++)
        out[i] = ((wide[i] + wide[i + 1]) + (wide[i + 2] + wide[i + 3])) +
                 ((wide[i + 4] + wide[i + 5]) + (wide[i + 6] + wide[i + 7]));
}
#endif
