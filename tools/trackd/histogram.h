/* histogram.h - quantiles of times in fixed memory, exact to 1.6 %. */
#ifndef TRACKD_HISTOGRAM_H
#define TRACKD_HISTOGRAM_H
#include <stdint.h>

enum { HISTOGRAM_BINS = 27 * 64 };

typedef struct histogram { /* all zero: empty */
    int64_t count;
    int32_t largest;
    uint32_t bin[HISTOGRAM_BINS];
} histogram;

/* Add one time in microseconds; negative counts as 0. */
void histogram_add(histogram *h, int64_t us);
/* The value below which `share` of the times lie, microseconds; 0 when empty. */
int32_t histogram_quantile(const histogram *h, double share);
#endif
