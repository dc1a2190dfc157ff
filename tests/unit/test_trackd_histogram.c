/* Quantiles against sorting, over the whole range of times. */
#include "../../tools/trackd/timing.c"
#include "check.h"

#include <stdlib.h>

enum { N = 5000 };

static int ascending(const void *a, const void *b)
{
    int32_t const x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

static void test_quantiles_are_exact_to_two_per_cent(void)
{
    static histogram h;
    static int32_t value[N];
    uint32_t random = 1;
    for (int i = 0; i < N; i++) {
        random = random * 1664525u + 1013904223u;
        value[i] = (int32_t)(random >> (i % 31 + 1));
        histogram_add(&h, value[i]);
    }
    qsort(value, N, sizeof *value, ascending);
    for (int percent = 1; percent <= 100; percent++) {
        int32_t const true_value = value[(N * percent + 99) / 100 - 1];
        CHECK_NEAR(histogram_quantile(&h, percent / 100.0), true_value, 0.02 * true_value + 0.5);
    }
    CHECK(h.count == N && h.largest == value[N - 1]);
}

static void test_edges(void)
{
    static histogram h;
    CHECK(histogram_quantile(&h, 0.5) == 0);
    histogram_add(&h, -5);
    CHECK(histogram_quantile(&h, 0.5) == 0 && h.count == 1);
    histogram_add(&h, INT64_MAX);
    CHECK(h.largest == INT32_MAX);
    CHECK_NEAR(histogram_quantile(&h, 1), INT32_MAX, 0.02 * INT32_MAX);
    for (int32_t v = 0; v < 128; v++) {
        histogram one = {0};
        histogram_add(&one, v);
        CHECK(histogram_quantile(&one, 0.5) == v);
    }
}

int main(void)
{
    test_quantiles_are_exact_to_two_per_cent();
    test_edges();
    return CHECK_DONE();
}
