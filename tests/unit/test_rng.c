#include "base/rng.h"

#include "check.h"

/* Known answers of Random123 (kat_vectors, philox4x32 10). */
static void test_known(void)
{
    static const struct {
        uint32_t counter[4];
        uint64_t key;
        uint32_t want[4];
    } known[] = {
        {{0, 0, 0, 0}, 0, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
        {{~0u, ~0u, ~0u, ~0u}, UINT64_MAX, {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
        {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
         UINT64_C(0x299f31d0a4093822),
         {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}},
    };
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        const uint32_t *const c = known[i].counter; /* index, draw, frame, stream */
        uint32_t out[4];
        rng_bits(known[i].key, c[3], c[2], c[0], c[1], out);
        CHECK(memcmp(out, known[i].want, sizeof out) == 0);
    }
}

static void test_uniform(void)
{
    enum { N = 50000, BINS = 20 };
    int bin[BINS] = {0};
    for (uint32_t i = 0; i < N; i++) {
        float u[4];
        rng_uniform4(11, 1, 2, i, 0, u);
        for (int k = 0; k < 4; k++) {
            if (!(u[k] >= 0.0f && u[k] < 1.0f))
                check_that(0, "uniform in [0, 1)", __FILE__, __LINE__);
            bin[(int)(u[k] * BINS)]++;
        }
    }
    double chi2 = 0.0, expected = 4.0 * N / BINS;
    for (int i = 0; i < BINS; i++)
        chi2 += (bin[i] - expected) * (bin[i] - expected) / expected;
    CHECK_NEAR(chi2, BINS - 1, 25.0); /* sd 6.2 */
}

/* Moments and tail against the standard normal; the limits are 4 standard errors. */
static void test_normal(void)
{
    enum { N = 100000 };
    double m[5] = {0}, cross = 0.0, largest = 0.0;
    int beyond = 0;
    for (uint32_t i = 0; i < N / 4; i++) {
        float x[4];
        rng_normal4(5, 7, 3, i, 1, x);
        for (int k = 0; k < 4; k++) {
            double const v = (double)x[k];
            for (int p = 1; p <= 4; p++)
                m[p] += pow(v, p) / N;
            beyond += fabs(v) > 2.5758293; /* 1 % */
            largest = fmax(largest, fabs(v));
        }
        cross += (double)x[0] * (double)x[1] + (double)x[2] * (double)x[3];
    }
    CHECK_NEAR(m[1], 0.0, 4.0 / sqrt(N));
    CHECK_NEAR(m[2], 1.0, 4.0 * sqrt(2.0 / N));
    CHECK_NEAR(m[3], 0.0, 4.0 * sqrt(15.0 / N));
    CHECK_NEAR(m[4], 3.0, 4.0 * sqrt(96.0 / N));
    CHECK_NEAR(beyond / (double)N, 0.01, 4.0 * sqrt(0.0099 / N));
    CHECK_NEAR(cross / (N / 2), 0.0, 4.0 * sqrt(2.0 / N));
    CHECK(largest > 3.8 && largest < 6.7);
}

/* Every argument matters. */
static void test_distinct(void)
{
    float base[4], other[6][4];
    rng_normal4(1, 2, 3, 4, 5, base);
    rng_normal4(2, 2, 3, 4, 5, other[0]);
    rng_normal4(1 + (UINT64_C(1) << 40), 2, 3, 4, 5, other[1]);
    rng_normal4(1, 3, 3, 4, 5, other[2]);
    rng_normal4(1, 2, 4, 4, 5, other[3]);
    rng_normal4(1, 2, 3, 5, 5, other[4]);
    rng_normal4(1, 2, 3, 4, 6, other[5]);
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < 4; k++)
            CHECK(base[k] != other[i][k]);
}

int main(void)
{
    test_known();
    test_uniform();
    test_normal();
    test_distinct();
    return CHECK_DONE();
}
