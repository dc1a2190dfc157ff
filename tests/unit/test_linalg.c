#include "base/linalg.h"

#include "base/rng.h"

#include "check.h"

/* sum += w q q' */
static void add(double sum[16], const double q[4], double w)
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            sum[4 * i + j] += w * q[i] * q[j];
}

static void random_quaternion(uint32_t i, double q[4])
{
    float x[4];
    rng_normal4(3, 0, 0, i, 0, x);
    double n = 0.0;
    for (int k = 0; k < 4; k++)
        n += (double)x[k] * (double)x[k];
    for (int k = 0; k < 4; k++)
        q[k] = (double)x[k] / sqrt(n);
}

/* One rotation: its mean is itself, with the sign that the header promises. */
static void test_single(void)
{
    for (uint32_t i = 0; i < 50; i++) {
        double q[4], sum[16] = {0};
        float mean[4];
        random_quaternion(i, q);
        add(sum, q, 0.7);
        la_rotation_mean(sum, mean);
        double const sign = q[0] < 0.0 ? -1.0 : 1.0;
        for (int k = 0; k < 4; k++)
            CHECK_NEAR(mean[k], sign * q[k], 1e-6);
    }
    const double axis[4] = {0, -1, 0, 0};
    double sum[16] = {0};
    float mean[4];
    add(sum, axis, 1.0);
    la_rotation_mean(sum, mean);
    CHECK(mean[0] == 0.0f && mean[1] == 1.0f && mean[2] == 0.0f && mean[3] == 0.0f);
}

/* q and -q are the same rotation; two turns about one axis average to the turn half way. */
static void test_pair(void)
{
    const double a[4] = {cos(0.1), 0, 0, sin(0.1)}, b[4] = {-cos(0.4), 0, 0, -sin(0.4)};
    double sum[16] = {0};
    float mean[4];
    add(sum, a, 1.0);
    add(sum, b, 1.0);
    la_rotation_mean(sum, mean);
    CHECK_NEAR(mean[0], cos(0.25), 1e-6);
    CHECK_NEAR(mean[3], sin(0.25), 1e-6);
}

/* Against the definition: no other unit vector gives a larger q'Aq. */
static void test_largest(void)
{
    for (uint32_t set = 0; set < 20; set++) {
        double sum[16] = {0}, best = 0.0;
        float mean[4];
        for (uint32_t i = 0; i < 30; i++) {
            double q[4];
            random_quaternion(1000 + 30 * set + i, q);
            add(sum, q, 1.0 / (1.0 + i));
        }
        la_rotation_mean(sum, mean);
        double norm = 0.0;
        for (int i = 0; i < 4; i++)
            for (int j = 0; j < 4; j++)
                best += (double)mean[i] * sum[4 * i + j] * (double)mean[j];
        for (int i = 0; i < 4; i++)
            norm += (double)mean[i] * (double)mean[i];
        CHECK_NEAR(norm, 1.0, 1e-6);
        for (uint32_t i = 0; i < 200; i++) {
            double q[4], value = 0.0;
            random_quaternion(5000 + i, q);
            for (int r = 0; r < 4; r++)
                for (int c = 0; c < 4; c++)
                    value += q[r] * sum[4 * r + c] * q[c];
            if (value > best * (1.0 + 1e-6))
                check_that(0, "principal eigenvector", __FILE__, __LINE__);
        }
        for (int i = 0; i < 4; i++) { /* A q = lambda q */
            double row = 0.0;
            for (int j = 0; j < 4; j++)
                row += sum[4 * i + j] * (double)mean[j];
            CHECK_NEAR(row, best * (double)mean[i], 2e-6 * best);
        }
    }
}

int main(void)
{
    test_single();
    test_pair();
    test_largest();
    return CHECK_DONE();
}
