/* cholesky.h - symmetric positive definite systems in double precision, of any size, in the caller's memory.
 *
 * The normal equations of rows w theta = y are stored as one matrix [W y]'[W y]: upper triangle, row-major,
 * ld x ld with ld = cholesky_padded(n + 1). Rows from n + 1 on are those of the identity. Elements below the
 * diagonal are undefined. */
#ifndef GAIT_BASE_CHOLESKY_H
#define GAIT_BASE_CHOLESKY_H
#include "base/dispatch.h"

enum { CHOLESKY_LANES = 8, CHOLESKY_FLOATS = 16 }; /* elements of the widest register: doubles, floats */

static inline int32_t cholesky_padded(int32_t n)
{
    return (n + CHOLESKY_LANES - 1) / CHOLESKY_LANES * CHOLESKY_LANES;
}

/* Leading dimension for cholesky_forward_float. */
static inline int32_t cholesky_padded_float(int32_t n)
{
    return (n + CHOLESKY_FLOATS - 1) / CHOLESKY_FLOATS * CHOLESKY_FLOATS;
}

/* theta = U^-1 z from a factored A; theta has ld elements. */
void cholesky_solve(const double *A, int32_t n, int32_t ld, double *theta);
/* Sum of log U_ii. */
double cholesky_log_det(const double *A, int32_t n, int32_t ld);
/* v = U^-T v, in place. */
void cholesky_forward_vector(const double *A, int32_t n, int32_t ld, double *v);
/* v = U^-1 v, in place; v has ld elements, and those from n on become 0. */
void cholesky_backward(const double *A, int32_t n, int32_t ld, double *v);
/* Eigenvectors of a symmetric S (n x n, full, leading dimension ld) by Jacobi rotations. S becomes diagonal,
 * and row i of V (ld) is the eigenvector of S[i][i]. Largest eigenvalue first. */
void symmetric_eigen(double *S, double *V, int32_t n, int32_t ld);
#endif
