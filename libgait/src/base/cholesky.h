/* cholesky.h - symmetric positive definite systems in double, of any size, in the caller's memory.
 *
 * The normal equations of rows w theta = y are kept as one matrix [W y]'[W y]: upper triangle, row-major, ld
 * x ld, ld = cholesky_padded(n + 1).  Rows past n are those of the identity; what lies below the diagonal means
 * nothing. */
#ifndef GAIT_BASE_CHOLESKY_H
#define GAIT_BASE_CHOLESKY_H
#include "base/dispatch.h"

enum { CHOLESKY_LANES = 8, CHOLESKY_FLOATS = 16 }; /* numbers in the widest register: doubles, floats */

static inline int32_t cholesky_padded(int32_t n)
{
    return (n + CHOLESKY_LANES - 1) / CHOLESKY_LANES * CHOLESKY_LANES;
}

/* Columns for cholesky_forward_float. */
static inline int32_t cholesky_padded_float(int32_t n)
{
    return (n + CHOLESKY_FLOATS - 1) / CHOLESKY_FLOATS * CHOLESKY_FLOATS;
}

/* theta = U^-1 z, from a factored A; ld numbers. */
void cholesky_solve(const double *A, int32_t n, int32_t ld, double *theta);
/* sum of log U_ii. */
double cholesky_log_det(const double *A, int32_t n, int32_t ld);
/* v = U^-T v, in place. */
void cholesky_forward_vector(const double *A, int32_t n, int32_t ld, double *v);
/* v = U^-1 v, in place; ld numbers, those past n become 0. */
void cholesky_backward(const double *A, int32_t n, int32_t ld, double *v);
/* Eigenvectors of a symmetric S (n x n, full, ld) by Jacobi rotations: S becomes diagonal, row i of V (ld)
 * the vector of S[i][i]. Largest first. */
void symmetric_eigen(double *S, double *V, int32_t n, int32_t ld);
#endif
