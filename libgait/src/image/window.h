/* window.h - sums over a sliding window of a row of the working image, replicated at its ends. */
#ifndef GAIT_IMAGE_WINDOW_H
#define GAIT_IMAGE_WINDOW_H
#include "image/view.h"

/* The row with `radius` more on each side. */
#define WINDOW_WIDTH(radius) (VIEW_SIZE + 2 * (radius))

/* Replicate the first and last of the VIEW_SIZE values that begin at wide[radius]. */
static inline void window_ends(int32_t *simd_f64, int32_t radius)
{
    for (int32_t i = 0; i < radius; i++) {
        simd_f64[i] = simd_f64[radius];
        simd_f64[radius + VIEW_SIZE + i] = simd_f64[radius + VIEW_SIZE - 1];
    }
}

/* Sums of eight neighbours, of which the sums of longer windows are made: out[i] = wide[i] + ... + wide[i + 7]. */
static inline void window_eight(const int32_t *simd_f64, int32_t radius, int32_t *restrict out)
{
    for (int32_t i = 0; i < WINDOW_WIDTH(radius) - 7; i++)
        out[i] = ((simd_f64[i] + simd_f64[i + 1]) + (simd_f64[i + 2] + simd_f64[i + 3])) +
                 ((simd_f64[i + 4] + simd_f64[i + 5]) + (simd_f64[i + 6] + simd_f64[i + 7]));
}
#endif
