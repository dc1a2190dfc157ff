/* Inner loops of normal equations. Each element is a sum in the order of the rows, so that the number of
 * lanes does not change the result. Blocks of eight rows stay in registers while the other rows are read. */
#include "base/cholesky.h"
#include "base/simd_f64.h"

enum { ROWS = CHOLESKY_LANES };

#define EACH_ROW(k) _Pragma("GCC unroll 8") for (int32_t k = 0; k < ROWS; k++)

#define NUMBER    double
#define SIMD_F64S simd_f64
#define UPDATE    update
#include "base/cholesky_update.h"
#undef NUMBER
#undef SIMD_F64S
#undef UPDATE
#define NUMBER    float
#define SIMD_F64S simd_f64_float
#define UPDATE    update_float
#include "base/cholesky_update.h"

void KERNEL(cholesky_rank)(double *A, int32_t ld, const double *W, int32_t count)
{
    for (int32_t i = 0; i < ld; i += ROWS)
        update(A, A, ld, i, i, ld, 1.0, W, ld, W, ld, count, NULL);
}

void KERNEL(cholesky_forward)(const double *U, int32_t n, int32_t ld, double *Z, int32_t ldz, int32_t width)
{
    for (int32_t i = 0; i < n; i += ROWS)
        update(Z, Z, ldz, i, 0, width, -1.0, U, ld, Z, ldz, i, U + (size_t)i * (size_t)(ld + 1));
}

void KERNEL(cholesky_forward_float)(const double *U, int32_t n, int32_t ld, float *V, int32_t width)
{
    float *const T = V + ld * width;
    for (int32_t i = 0; i < ld; i++)
        for (int32_t j = i / ROWS * ROWS; j < ld; j += SIMD_F64)
            simd_f64_store_float(T + i * ld + j, simd_f64_load(U + i * ld + j));
    for (int32_t i = 0; i < n; i += ROWS)
        update_float(V, V, width, i, 0, width, -1.0f, T, ld, V, width, i, T + i * (ld + 1));
}

/* Factor the first n rows of a block on the diagonal: first as L D L', so that the pivots do not wait for
 * square roots. */
static bool factor_corner(double *A, int32_t ld, int32_t n)
{
    for (int32_t i = 0; i < n; i++) {
        const double *const row = A + i * ld;
        if (!(row[i] > 0.0))
            return false;
        double const inverse = 1.0 / row[i];
        for (int32_t k = i + 1; k < ROWS; k++) {
            double const part = row[k] * inverse;
            double *const to = A + k * ld;
            _Pragma("GCC unroll 8") for (int32_t j = 0; j < ROWS;
                                         j += SIMD_F64) /* columns left of k are undefined */
                simd_f64_store(to + j, simd_f64_load(to + j) - part * simd_f64_load(row + j));
        }
    }
    for (int32_t i = 0; i < n; i++) {
        double *const row = A + i * ld, root = sqrt(row[i]), inverse = 1.0 / root;
        _Pragma("GCC unroll 8") for (int32_t j = 0; j < ROWS; j += SIMD_F64)
            simd_f64_store(row + j, simd_f64_load(row + j) * inverse);
        row[i] = root;
    }
    return true;
}

bool KERNEL(cholesky_factor)(const double *A, double *U, int32_t n, int32_t ld)
{
    for (int32_t i = 0; i < ld; i += ROWS) { /* the last block may begin with row n, which holds y */
        double *const corner = U + (size_t)i * (size_t)(ld + 1);
        int32_t const rows = n - i < ROWS ? n - i : ROWS;
        update(A, U, ld, i, i, i + ROWS, -1.0, U, ld, U, ld, i, NULL);
        if (!factor_corner(corner, ld, rows))
            return false;
        update(A, U, ld, i, i + ROWS, ld, -1.0, U, ld, U, ld, i, corner);
    }
    return true;
}
