/* dense.h - symmetric positive definite systems in double, of any size, in the caller's memory.
 *
 * The normal equations of rows w theta = y are kept as one matrix [W y]'[W y]: upper triangle, row-major, ld
 * x ld, ld = dense_padded(n + 1).  Rows past n are those of the identity; what lies below the diagonal means
 * nothing. */
#ifndef GAIT_DENSE_H
#define GAIT_DENSE_H
#include "kernels.h"

enum { DENSE_LANES = 8, DENSE_FLOATS = 16 }; /* numbers in the widest register: doubles, floats */

static inline int32_t dense_padded(int32_t n)
{
    return (n + DENSE_LANES - 1) / DENSE_LANES * DENSE_LANES;
}

/* Columns for dense_forward_float. */
static inline int32_t dense_padded_float(int32_t n)
{
    return (n + DENSE_FLOATS - 1) / DENSE_FLOATS * DENSE_FLOATS;
}

/* theta = U^-1 z, from a factored A; ld numbers. */
void dense_solve(const double *A, int32_t n, int32_t ld, double *theta);
/* sum of log U_ii. */
double dense_log_det(const double *A, int32_t n, int32_t ld);
/* v = U^-T v, in place. */
void dense_ahead(const double *A, int32_t n, int32_t ld, double *v);
/* v = U^-1 v, in place; ld numbers, those past n become 0. */
void dense_back(const double *A, int32_t n, int32_t ld, double *v);
/* Eigenvectors of a symmetric S (n x n, full, ld) by Jacobi rotations: S becomes diagonal, row i of V (ld)
 * the vector of S[i][i]. Largest first. */
void dense_eigen(double *S, double *V, int32_t n, int32_t ld);
#endif
