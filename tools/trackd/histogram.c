#include "histogram.h"

#include <math.h>

/* Values below 64 have bins of their own; above, each octave has 64. */
static int bin_of(uint32_t v)
{
    int octave = 0;
    for (; v >= 128; v >>= 1)
        octave++;
    return octave * 64 + (int)v;
}

/* Middle of the values that share a bin. */
static uint32_t value_of(int bin)
{
    int const octave = bin < 128 ? 0 : bin / 64 - 1;
    return (((uint32_t)(bin - octave * 64) << octave) * 2 + (1u << octave) - 1) / 2;
}

void histogram_add(histogram *h, int64_t us)
{
    int32_t const v = us < 0 ? 0 : us > INT32_MAX ? INT32_MAX : (int32_t)us;
    int const bin = bin_of((uint32_t)v);
    h->bin[bin]++;
    h->count++;
    h->largest = v > h->largest ? v : h->largest;
}

int32_t histogram_quantile(const histogram *h, double share)
{
    int64_t const rank = (int64_t)ceil(share * (double)h->count);
    int64_t below = 0;
    for (int bin = 0; bin < HISTOGRAM_BINS; bin++) {
        below += h->bin[bin];
        if (h->bin[bin] && below >= rank) {
            uint32_t const v = value_of(bin);
            return v > (uint32_t)h->largest ? h->largest : (int32_t)v;
        }
    }
    return 0;
}
