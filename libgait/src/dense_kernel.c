/* Inner loops of normal equations: each element is a sum in the order of the rows, so that lanes change
 * nothing.  Blocks of eight rows stay in registers while the others go by. */
#include "dense.h"
#include "wide.h"

enum { ROWS = DENSE_LANES };

#define EACH_ROW(k) _Pragma("GCC unroll 8") for (int32_t k = 0; k < ROWS; k++)

#define NUMBER double
#define WIDES  wide
#define UPDATE update
#include "dense_update.h"
#undef NUMBER
#undef WIDES
#undef UPDATE
#define NUMBER float
#define WIDES  wide_float
#define UPDATE update_float
#include "dense_update.h"

void KERNEL(dense_rank)(double *A, int32_t ld, const double *W, int32_t count)
{
    for (int32_t i = 0; i < ld; i += ROWS)
        update(A, ld, i, i, ld, 1.0, W, ld, W, ld, count, NULL);
}

void KERNEL(dense_forward)(const double *U, int32_t n, int32_t ld, double *Z, int32_t ldz, int32_t width)
{
    for (int32_t i = 0; i < n; i += ROWS)
        update(Z, ldz, i, 0, width, -1.0, U, ld, Z, ldz, i, U + (size_t)i * (size_t)(ld + 1));
}

void KERNEL(dense_forward_float)(const double *U, int32_t n, int32_t ld, const double *Z, int32_t width,
                                 float *V)
{
    float *const T = V + ld * width;
    for (int32_t i = 0; i < ld * width; i++)
        V[i] = (float)Z[i];
    for (int32_t i = 0; i < ld; i++)
        for (int32_t j = i / ROWS * ROWS; j < ld; j++)
            T[i * ld + j] = (float)U[i * ld + j];
    for (int32_t i = 0; i < n; i += ROWS)
        update_float(V, width, i, 0, width, -1.0f, T, ld, V, width, i, T + i * (ld + 1));
}

/* Factor a block on the diagonal, the first n of its rows. */
static bool factor_corner(double *A, int32_t ld, int32_t n)
{
    for (int32_t i = 0; i < n; i++) {
        double *const row = A + i * ld;
        if (!(row[i] > 0.0))
            return false;
        double const root = sqrt(row[i]), inverse = 1.0 / root;
        row[i] = root;
        for (int32_t j = i + 1; j < ROWS; j++)
            row[j] *= inverse;
        for (int32_t k = i + 1; k < ROWS; k++)
            for (int32_t j = k; j < ROWS; j++)
                A[k * ld + j] -= row[k] * row[j];
    }
    return true;
}

bool KERNEL(dense_factor)(double *A, int32_t n, int32_t ld)
{
    for (int32_t i = 0; i < n; i += ROWS) {
        double *const corner = A + (size_t)i * (size_t)(ld + 1);
        update(A, ld, i, i, i + ROWS, -1.0, A, ld, A, ld, i, NULL);
        if (!factor_corner(corner, ld, n - i < ROWS ? n - i : ROWS))
            return false;
        update(A, ld, i, i + ROWS, ld, -1.0, A, ld, A, ld, i, corner);
    }
    return true;
}
