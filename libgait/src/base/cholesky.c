#include "base/cholesky.h"

#include "base/fmath.h"
#include "base/simd_f64.h"

/* Sum of u[j] v[j] over j < count, a multiple of CHOLESKY_LANES, as CHOLESKY_LANES independent sums. */
static double dot(const double *u, const double *v, int32_t count)
{
    simd_f64 sum[CHOLESKY_LANES / SIMD_F64] = {{0.0}};
    double s[CHOLESKY_LANES];
    for (int32_t j = 0; j < count; j += CHOLESKY_LANES)
        _Pragma("GCC unroll 8") for (int32_t k = 0; k < CHOLESKY_LANES / SIMD_F64; k++)
        {
            sum[k] += simd_f64_load(u + j + k * SIMD_F64) * simd_f64_load(v + j + k * SIMD_F64);
        }
    memcpy(s, sum, sizeof s);
    return ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
}

void cholesky_forward_vector(const double *A, int32_t n, int32_t ld, double *v)
{
    for (int32_t i = 0; i < n; i++) {
        const double *const u = A + (size_t)i * (size_t)ld;
        v[i] /= u[i];
        for (int32_t j = i + 1; j < n; j++)
            v[j] -= u[j] * v[i];
    }
}

void cholesky_backward(const double *A, int32_t n, int32_t ld, double *v)
{
    memset(v + n, 0, (size_t)(ld - n) * sizeof *v);
    for (int32_t first = cholesky_padded(n) - CHOLESKY_LANES; first >= 0; first -= CHOLESKY_LANES) {
        int32_t const last = first + CHOLESKY_LANES;
        const double *const rows = A + (size_t)first * (size_t)ld;
        double inverse[CHOLESKY_LANES];
        for (int32_t i = first; i < i_min(last, n); i++) { /* subtract the part of the solved blocks */
            const double *const u = A + (size_t)i * (size_t)ld;
            inverse[i - first] = 1.0 / u[i];
            v[i] -= dot(u + last, v + last, ld - last);
        }
        for (int32_t i = i_min(last, n) - 1; i >= first; i--) {
            v[i] *= inverse[i - first];
            for (int32_t k = first; k < i; k++)
                v[k] -= rows[(size_t)(k - first) * (size_t)ld + (size_t)i] * v[i];
        }
    }
}

void cholesky_solve(const double *A, int32_t n, int32_t ld, double *theta)
{
    for (int32_t i = 0; i < n; i++)
        theta[i] = A[(size_t)i * (size_t)ld + (size_t)n];
    cholesky_backward(A, n, ld, theta);
}

double cholesky_log_det(const double *A, int32_t n, int32_t ld)
{
    double sum = 0.0;
    for (int32_t i = 0; i < n; i++)
        sum += m_log64(A[(size_t)i * (size_t)(ld + 1)]);
    return sum;
}

/* Rotate rows p and q of M by (c, s). */
static void turn(double *M, int32_t n, int32_t ld, int32_t p, int32_t q, double c, double s)
{
    double *const a = M + (size_t)p * (size_t)ld, *const b = M + (size_t)q * (size_t)ld;
    for (int32_t j = 0; j < n; j++) {
        double const x = a[j], y = b[j];
        a[j] = c * x - s * y;
        b[j] = s * x + c * y;
    }
}

/* Make S[p][q] zero (Jacobi; Golub and Van Loan, section 8.5). False if it is already within `tiny` of zero. */
static bool annihilate(double *S, double *V, int32_t n, int32_t ld, int32_t p, int32_t q, double tiny)
{
    double const off = S[p * ld + q], dp = S[p * ld + p], dq = S[q * ld + q];
    if (fabs(off) <= tiny)
        return false;
    double const tau = (dq - dp) / (2.0 * off);
    double const t = (tau >= 0.0 ? 1.0 : -1.0) / (fabs(tau) + sqrt(1.0 + tau * tau));
    double const c = 1.0 / sqrt(1.0 + t * t), s = t * c;
    turn(S, n, ld, p, q, c, s);
    for (int32_t i = 0; i < n; i++) {
        double *const row = S + (size_t)i * (size_t)ld;
        double const x = row[p], y = row[q];
        row[p] = c * x - s * y;
        row[q] = s * x + c * y;
    }
    S[p * ld + q] = S[q * ld + p] = 0.0;
    turn(V, n, ld, p, q, c, s);
    return true;
}

/* Swap the eigenpairs i and j. */
static void mirror(double *S, double *V, int32_t n, int32_t ld, int32_t i, int32_t j)
{
    double const s = S[i * ld + i];
    S[i * ld + i] = S[j * ld + j];
    S[j * ld + j] = s;
    for (int32_t c = 0; c < n; c++) {
        double const v = V[i * ld + c];
        V[i * ld + c] = V[j * ld + c];
        V[j * ld + c] = v;
    }
}

void symmetric_eigen(double *S, double *V, int32_t n, int32_t ld)
{
    for (int32_t i = 0; i < n; i++)
        for (int32_t j = 0; j < n; j++)
            V[i * ld + j] = i == j;
    double largest = DBL_MIN;
    for (int32_t i = 0; i < n; i++)
        largest = fabs(S[i * ld + i]) > largest ? fabs(S[i * ld + i]) : largest;
    bool moved = true;
    for (int32_t sweep = 0; moved && sweep < 40; sweep++) {
        moved = false;
        for (int32_t p = 0; p < n - 1; p++)
            for (int32_t q = p + 1; q < n; q++)
                moved |= annihilate(S, V, n, ld, p, q, 1e-17 * largest);
    }
    for (int32_t i = 0; i < n; i++) {
        int32_t best = i;
        for (int32_t j = i + 1; j < n; j++)
            best = S[j * ld + j] > S[best * ld + best] ? j : best;
        if (best != i)
            mirror(S, V, n, ld, i, best);
    }
}
