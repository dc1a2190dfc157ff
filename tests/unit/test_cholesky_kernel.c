/* Kernels of symmetric systems over sizes, places in memory and canary borders: the scalar ones against plain sums, the
 * others against the scalar ones. */
#include "base/cholesky.h"

#include "check.h"
#include "kernel_check.h"
#include "toy_segment.h"

enum {
    MOST = GAIT_MAX_MODES,
    LD = MOST + CHOLESKY_LANES,
    ROWS = 11,
    OFFSETS = 8,
    NUMBERS = LD * (LD + CHOLESKY_LANES)
};

typedef struct block { /* numbers between canaries */
    _Alignas(64) unsigned char memory[NUMBERS * sizeof(double) + OFFSETS * sizeof(double) + 2 * GUARD];
    guarded in;
} block;

/* So many bytes, `off` after an aligned place. */
static void *begin(block *b, size_t bytes, size_t off)
{
    b->in = guard_fill(b->memory + off, bytes);
    return b->in.begin;
}

typedef struct system {
    block rank, factor, forward, about; /* output of each kernel */
    bool definite;
} system_of;

typedef struct shape {
    int32_t n, ld, rows, width, ldz, floats; /* floats: columns of those */
    size_t off;                              /* numbers past an aligned place */
} shape;

static shape shape_of(int32_t n)
{
    int32_t const ld = cholesky_padded(n + 1), width = CHOLESKY_LANES * (1 + n % (ld / CHOLESKY_LANES));
    return (shape){.n = n,
                   .ld = ld,
                   .rows = n % (ROWS + 1),
                   .width = width,
                   .ldz = width + CHOLESKY_LANES * (n % 2),
                   .floats = cholesky_padded_float(width),
                   .off = (size_t)n % OFFSETS};
}

/* All rows of n + 1 numbers, followed by zeros. */
static double *rows_of(const shape *s, block *b)
{
    uint32_t seed = 3;
    double *const W = begin(b, (size_t)(ROWS * s->ld) * sizeof(double), s->off * sizeof(double));
    for (int32_t i = 0; i < ROWS * s->ld; i++)
        W[i] = i % s->ld <= s->n ? toy_random(&seed) : 0.0;
    return W;
}

static double start(const shape *s, int32_t i, int32_t j)
{
    return i == j && i != s->n ? 1.0 : i < s->n && j == s->n ? 0.25 * i : 0.0;
}

static void run(const kernels *k, const shape *s, system_of *out)
{
    static block rows;
    const double *const W = rows_of(s, &rows);
    size_t const square = (size_t)(s->ld * s->ld) * sizeof(double), off = s->off * sizeof(double);
    double *const A = begin(&out->rank, square, off), *const U = begin(&out->factor, square, off);
    double *const Z = begin(&out->forward, (size_t)(cholesky_padded(s->n) * s->ldz) * sizeof(double), off);
    float *const V = begin(&out->about, (size_t)(s->ld * (s->floats + s->ld)) * sizeof(float), off / 2);
    uint32_t seed = 17;
    for (int32_t i = 0; i < s->ld * s->ld; i++)
        A[i] = start(s, i / s->ld, i % s->ld);
    k->cholesky_rank(A, s->ld, W, s->rows);
    out->definite = k->cholesky_factor(A, U, s->n, s->ld);
    for (int32_t i = 0; i < cholesky_padded(s->n) * s->ldz; i++)
        Z[i] = toy_random(&seed);
    for (int32_t i = 0; i < s->ld * s->floats; i++) {
        int32_t const row = i / s->floats, column = i % s->floats;
        V[i] = row < s->n && column < s->width ? (float)Z[row * s->ldz + column] : 0.0f;
    }
    k->cholesky_forward(U, s->n, s->ld, Z, s->ldz, s->width);
    k->cholesky_forward_float(U, s->n, s->ld, V, s->floats);
}

/* Rows of `ld` from the diagonal on. */
static bool same_above(const shape *s, const block *a, const block *b)
{
    bool same = true;
    for (int32_t i = 0; i <= s->n; i++) {
        size_t const at = (size_t)(i * s->ld + i) * sizeof(double);
        same =
            same && memcmp(a->in.begin + at, b->in.begin + at, (size_t)(s->n + 1 - i) * sizeof(double)) == 0;
    }
    return same;
}

static void compare(const shape *s, const system_of *want, const system_of *have)
{
    CHECK(have->definite);
    CHECK(same_above(s, &have->rank, &want->rank) && same_above(s, &have->factor, &want->factor));
    CHECK(memcmp(have->forward.in.begin, want->forward.in.begin, (size_t)(s->n * s->ldz) * sizeof(double)) ==
          0);
    CHECK(memcmp(have->about.in.begin, want->about.in.begin, (size_t)(s->n * s->floats) * sizeof(float)) ==
          0);
    CHECK(guard_whole(&have->rank.in) && guard_whole(&have->factor.in));
    CHECK(guard_whole(&have->forward.in) && guard_whole(&have->about.in));
}

/* The scalar kernels: sums in the order of the rows, to the bit; what lies past a row's width stays. */
static void check_scalar(const shape *s, const system_of *scalar)
{
    static block rows;
    const double *const W = rows_of(s, &rows), *const A = (const double *)(const void *)scalar->rank.in.begin,
                        *const Z = (const double *)(const void *)scalar->forward.in.begin;
    uint32_t seed = 17;
    int32_t wrong = 0;
    for (int32_t i = 0; i <= s->n; i++)
        for (int32_t j = i; j <= s->n; j++) {
            double sum = start(s, i, j);
            for (int32_t r = 0; r < s->rows; r++)
                sum += W[r * s->ld + i] * W[r * s->ld + j];
            wrong += sum != A[i * s->ld + j];
        }
    for (int32_t i = 0; i < s->n * s->ldz; i++) {
        double const before = toy_random(&seed);
        wrong += i % s->ldz >= s->width && Z[i] != before;
    }
    CHECK(wrong == 0);
}

int main(void)
{
    static system_of want, have;
    for (int32_t n = 1; n <= MOST; n++) {
        shape const s = shape_of(n);
        run(isa_scalar(), &s, &want);
        check_scalar(&s, &want);
        compare(&s, &want, &want);
        for (int k = 0; k < isa_count(); k++) {
            run(isa_at(k), &s, &have);
            compare(&s, &want, &have);
        }
    }
    return CHECK_DONE();
}
