/* Inner loops of normal equations: each element is a sum in the order of the rows, so that lanes change
 * nothing. */
#include "dense.h"

/* One row of a rank-4 update, lanes side by side; j begins at a multiple of DENSE_LANES. */
static inline void add_four(double *restrict a, const double *restrict w, int32_t ld, const double f[4],
                            int32_t first, int32_t width)
{
    const double *restrict const w1 = w + ld, *restrict const w2 = w + 2 * ld,
                                 *restrict const w3 = w + 3 * ld;
    for (int32_t j = first / DENSE_LANES * DENSE_LANES; j < width; j++)
        a[j] = (((a[j] + f[0] * w[j]) + f[1] * w1[j]) + f[2] * w2[j]) + f[3] * w3[j];
}

static inline void add_one(double *restrict a, const double *restrict w, double f, int32_t first,
                           int32_t width)
{
    for (int32_t j = first / DENSE_LANES * DENSE_LANES; j < width; j++)
        a[j] += f * w[j];
}

void KERNEL(dense_rank)(double *A, int32_t ld, int32_t first, int32_t last, const double *W, int32_t rows,
                        double sign)
{
    int32_t r = 0;
    for (; r + 4 <= rows; r += 4) {
        const double *const w = W + (size_t)r * (size_t)ld;
        for (int32_t i = first; i < last; i++) {
            const double f[4] = {sign * w[i], sign * w[ld + i], sign * w[2 * ld + i], sign * w[3 * ld + i]};
            add_four(A + (size_t)i * (size_t)ld, w, ld, f, i, ld);
        }
    }
    for (; r < rows; r++) {
        const double *const w = W + (size_t)r * (size_t)ld;
        for (int32_t i = first; i < last; i++)
            add_one(A + (size_t)i * (size_t)ld, w, sign * w[i], i, ld);
    }
}

void KERNEL(dense_forward)(const double *U, int32_t n, int32_t ld, double *Z, int32_t ldz, int32_t width)
{
    for (int32_t i = 0; i < n; i += 4) {
        int32_t const end = i_min(i + 4, n);
        for (int32_t p = i; p < end; p++) {
            const double *const u = U + (size_t)p * (size_t)ld;
            double *const zp = Z + (size_t)p * (size_t)ldz;
            double const inverse = 1.0 / u[p];
            for (int32_t c = 0; c < width; c++)
                zp[c] *= inverse;
            for (int32_t j = p + 1; j < end; j++)
                add_one(Z + (size_t)j * (size_t)ldz, zp, -u[j], 0, width);
        }
        const double *const u = U + (size_t)i * (size_t)ld;
        for (int32_t j = end; j < n; j++) { /* only after four full rows */
            const double f[4] = {-u[j], -u[ld + j], -u[2 * ld + j], -u[3 * ld + j]};
            add_four(Z + (size_t)j * (size_t)ldz, Z + (size_t)i * (size_t)ldz, ldz, f, 0, width);
        }
    }
}
