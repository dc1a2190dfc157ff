/* Symmetric systems against the products from which they were made, and the kernels against the scalar ones. */
#include "api/kernels.h"
#include "base/cholesky.h"

#include "check.h"
#include "toy_segment.h"

enum { MOST = 61, WIDEST = 64, ROWS = 150 };

static double W[ROWS * WIDEST], A[WIDEST * WIDEST], U[WIDEST * WIDEST], V[WIDEST * WIDEST];

/* Rows of n + 1 random numbers, and their products with 1 on the diagonal. */
static void make(const kernels *k, int32_t n, int32_t ld)
{
    uint32_t seed = 3;
    memset(W, 0, sizeof W);
    memset(A, 0, sizeof A);
    for (int32_t r = 0; r < ROWS; r++)
        for (int32_t j = 0; j <= n; j++)
            W[r * ld + j] = toy_random(&seed);
    for (int32_t i = 0; i < ld; i++)
        A[i * (ld + 1)] = i != n;
    k->cholesky_rank(A, ld, W, ROWS);
}

static void test_system(int32_t n)
{
    const kernels *const k = kernels_choose(~0u);
    int32_t const ld = cholesky_padded(n + 1);
    double theta[WIDEST], left = 0.0, log_det = 0.0;
    make(k, n, ld);
    for (int32_t i = 0; i < n; i++)
        for (int32_t j = i; j <= n; j++) {
            double sum = i == j;
            for (int32_t r = 0; r < ROWS; r++)
                sum += W[r * ld + i] * W[r * ld + j];
            CHECK_NEAR(A[i * ld + j], sum, 1e-11);
        }
    CHECK(k->cholesky_factor(A, U, n, ld));
    cholesky_solve(U, n, ld, theta);
    for (int32_t i = 0; i < n; i++) {
        double sum = 0.0;
        for (int32_t j = 0; j < n; j++)
            sum += A[i < j ? i * ld + j : j * ld + i] * theta[j];
        CHECK_NEAR(sum, A[i * ld + n], 1e-10);
        left += theta[i] * A[i * ld + n];
        log_det += log(U[i * (ld + 1)]);
    }
    CHECK_NEAR(U[n * (ld + 1)], A[n * (ld + 1)] - left, 1e-9);
    CHECK_NEAR(cholesky_log_det(U, n, ld), log_det, 1e-12);
}

/* Several right-hand sides at once give the same as each alone; with floats approximately. */
static void test_forward(int32_t n)
{
    const kernels *const k = kernels_choose(~0u);
    int32_t const ld = cholesky_padded(n + 1);
    uint32_t seed = 11;
    static float about[2 * WIDEST * WIDEST];
    double one[MOST], largest = 0.0;
    make(k, n, ld);
    CHECK(k->cholesky_factor(A, U, n, ld));
    for (int32_t i = 0; i < n * ld; i++)
        V[i] = toy_random(&seed);
    for (int32_t i = 0; i < n; i++)
        one[i] = V[i * ld + 2];
    for (int32_t i = 0; i < n * ld; i++)
        about[i] = (float)V[i];
    k->cholesky_forward_float(U, n, ld, about, ld);
    k->cholesky_forward(U, n, ld, V, ld, CHOLESKY_LANES);
    cholesky_forward_vector(U, n, ld, one);
    for (int32_t i = 0; i < n; i++)
        largest = fmax(largest, fabs(one[i]));
    for (int32_t i = 0; i < n; i++) {
        CHECK_NEAR(V[i * ld + 2], one[i], 1e-13 * fabs(one[i]) + 1e-15);
        CHECK_NEAR((double)about[i * ld + 2], one[i], 1e-6 * largest);
    }
}

static void test_eigen(int32_t n)
{
    int32_t const ld = cholesky_padded(n);
    make(kernels_choose(0), n - 1, ld);
    for (int32_t i = 0; i < n; i++)
        for (int32_t j = 0; j < i; j++)
            A[i * ld + j] = A[j * ld + i];
    memcpy(U, A, sizeof A);
    symmetric_eigen(U, V, n, ld);
    for (int32_t i = 0; i < n; i++) {
        CHECK(i == 0 || U[i * (ld + 1)] <= U[(i - 1) * (ld + 1)]);
        for (int32_t j = 0; j < n; j++) {
            double product = 0.0, image = 0.0;
            for (int32_t c = 0; c < n; c++) {
                product += V[i * ld + c] * V[j * ld + c];
                image += A[j * ld + c] * V[i * ld + c];
            }
            CHECK_NEAR(product, i == j, 1e-12);
            CHECK_NEAR(image, U[i * (ld + 1)] * V[i * ld + j], 1e-10);
        }
    }
}

static void test_refused(void)
{
    const kernels *const k = kernels_choose(~0u);
    make(k, 7, 8);
    A[3 * 9] = -1e6;
    CHECK(!k->cholesky_factor(A, A, 7, 8));
    make(k, 7, 8);
    A[5 * 9] = NAN;
    CHECK(!k->cholesky_factor(A, A, 7, 8));
}

/* Every instruction set gives the bits of the scalar code. */
static void test_kernels(void)
{
    static double first[WIDEST * WIDEST], solved[WIDEST * WIDEST];
    static float about[2 * WIDEST * WIDEST], about_first[MOST * WIDEST];
    for (uint32_t mask = 0; mask <= 7; mask = 2 * mask + 1) {
        const kernels *const k = kernels_choose(mask);
        uint32_t seed = 5;
        make(k, MOST, WIDEST);
        CHECK(k->cholesky_factor(A, A, MOST, WIDEST));
        for (int32_t i = 0; i < MOST * WIDEST; i++)
            about[i] = (float)(V[i] = toy_random(&seed));
        k->cholesky_forward_float(A, MOST, WIDEST, about, WIDEST);
        k->cholesky_forward(A, MOST, WIDEST, V, WIDEST, 40);
        if (mask == 0) {
            memcpy(first, A, sizeof A);
            memcpy(solved, V, sizeof V);
            memcpy(about_first, about, sizeof about_first);
        }
        for (int32_t i = 0; i < MOST; i++)
            CHECK(memcmp(first + i * WIDEST + i, A + i * WIDEST + i, (size_t)(MOST + 1 - i) * sizeof *A) ==
                  0);
        CHECK(memcmp(solved, V, (size_t)(MOST * WIDEST) * sizeof *V) == 0);
        CHECK(memcmp(about_first, about, sizeof about_first) == 0);
    }
}

int main(void)
{
    for (int32_t n = 1; n <= MOST; n += 6)
        test_system(n);
    test_system(8); /* y is the first row of a block of its own */
    test_system(16);
    test_forward(MOST);
    test_forward(6);
    test_eigen(2);
    test_eigen(17);
    test_eigen(54);
    test_refused();
    test_kernels();
    return CHECK_DONE();
}
