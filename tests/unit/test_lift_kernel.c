/* Positions by modes: every instruction set against the scalar definition, and that against the sum in order. */
#include "dense.h"
#include "rng.h"

#include "check.h"
#include "kernel_check.h"

#include <math.h>

enum { WIDEST = 75, MODES = 9, MISALIGNED = 4, NUMBERS = WIDEST + MISALIGNED };

static float number(uint32_t index)
{
    float n[4];
    rng_normal4(31, 0, 0, index, 0, n);
    return n[0];
}

typedef struct sums { /* canaries about as many positions as a width has */
    unsigned char memory[NUMBERS * sizeof(double) + 2 * GUARD];
    guarded in;
    double *x;
} sums;

/* Positions begin so many numbers after an aligned place. */
static void begin(sums *s, int32_t width, int32_t off)
{
    s->in = guard_fill(s->memory + (size_t)off * sizeof(double), (size_t)width * sizeof(double));
    s->x = (double *)(void *)s->in.begin;
    for (int32_t j = 0; j < width; j++)
        s->x[j] = (double)number((uint32_t)j) * 3.0;
}

static void compare(int32_t width, int32_t modes, int32_t off)
{
    static _Alignas(64) sums want, have;
    static float mode[(MODES + 1) * NUMBERS];
    double theta[MODES], wrong = 0.0;
    size_t const stride = (size_t)(width + off);
    for (uint32_t i = 0; i < sizeof mode / sizeof *mode; i++)
        mode[i] = number(1000 + i);
    for (uint32_t i = 0; i < MODES; i++)
        theta[i] = (double)number(500 + i);
    begin(&want, width, off);
    isa_scalar()->lift_sum(want.x, width, mode + off, stride, theta, modes);
    CHECK(guard_whole(&want.in));
    begin(&have, width, off);
    for (int32_t j = 0; j < width; j++) {
        double sum = have.x[j];
        for (int32_t i = 0; i < modes; i++)
            sum = sum + theta[i] * (double)mode[(size_t)off + (size_t)i * stride + (size_t)j];
        wrong += sum != want.x[j];
    }
    CHECK(wrong == 0.0);
    for (int k = 0; k < isa_count(); k++) {
        begin(&have, width, off);
        isa_at(k)->lift_sum(have.x, width, mode + off, stride, theta, modes);
        CHECK(memcmp(have.x, want.x, (size_t)width * sizeof(double)) == 0 && guard_whole(&have.in));
    }
}

/* ---- the kernels about one marker ---- */
enum { MOST_MODES = 27, MOST_LANES = 32, MARKERS = 5, WIDTH = 3 * MARKERS + 1, OFFSETS = 8 };
enum { SHAPE, MOVED, ROW, COLUMNS, SQUARES, PARTS };

typedef struct shapes { /* what they make, each between canaries */
    _Alignas(64) unsigned char memory[PARTS][(MOST_LANES * WIDTH + OFFSETS) * sizeof(double) + 2 * GUARD];
    guarded in[PARTS];
    double *part[PARTS];
    float about[MOST_LANES * WIDTH + OFFSETS]; /* columns */
} shapes;

static void clear(shapes *s, int32_t lanes, size_t off)
{
    const int32_t numbers[PARTS] = {3 * lanes, 3, lanes, lanes * WIDTH, WIDTH};
    for (int k = 0; k < PARTS; k++) {
        s->in[k] = guard_fill(s->memory[k] + off * sizeof(double), (size_t)numbers[k] * sizeof(double));
        memset(s->in[k].begin, 0, s->in[k].bytes);
        s->part[k] = (double *)(void *)s->in[k].begin;
    }
}

/* Everything begins `off` numbers past an aligned place. */
static void run(const kernels *k, int32_t modes, size_t off, shapes *s)
{
    static _Alignas(64) float mode[2][3 * MOST_LANES + OFFSETS];
    static _Alignas(64) double theta[MOST_MODES + OFFSETS];
    int32_t const lanes = dense_padded(modes);
    double M[3][3];
    clear(s, lanes, off);
    for (int32_t i = 0; i < 3 * lanes; i++)
        for (int32_t frame = 0; frame < 2; frame++)
            mode[frame][off + (size_t)i] = i % lanes < modes ? number((uint32_t)(i + 200 * frame)) : 0.0f;
    for (int32_t i = 0; i < modes; i++)
        theta[off + (size_t)i] = (double)number(400 + (uint32_t)i);
    for (uint32_t i = 0; i < 9; i++)
        M[i / 3][i % 3] = (double)number(600 + i);
    k->lift_shape(s->part[SHAPE], mode[0] + off, mode[1] + off, 0.75, 0.25, lanes, theta + off, modes,
                  s->part[MOVED]);
    k->lift_row(s->part[ROW], s->part[SHAPE], lanes, M[0]);
    for (int32_t r = 0; r < MARKERS; r++)
        k->lift_columns(s->part[COLUMNS] + 3 * r, WIDTH, s->part[SHAPE], lanes, M);
    for (int32_t i = 0; i < lanes * WIDTH; i++)
        s->about[off + (size_t)i] = (float)s->part[COLUMNS][i];
    k->lift_squares(s->part[SQUARES], (int32_t)(modes % WIDTH) + 1, s->about + off, WIDTH, modes);
}

/* In plain order, about the same sums. */
static void check_sums(const shapes *s, int32_t modes)
{
    int32_t const lanes = dense_padded(modes);
    const double *const columns = s->part[COLUMNS];
    for (int32_t a = 0; a < 3; a++) {
        double moved = 0.0, squares = 0.0;
        for (int32_t i = 0; i < modes; i++) {
            double const column = columns[i * WIDTH + a], about = (double)(float)column;
            moved += s->part[SHAPE][a * lanes + i] * (double)number(400 + (uint32_t)i);
            squares += about * about;
            CHECK(column == columns[i * WIDTH + 3 * (MARKERS - 1) + a]);
            CHECK(a > 0 || column == s->part[ROW][i]);
        }
        CHECK(fabs(moved - s->part[MOVED][a]) < 1e-12);
        CHECK(fabs((a <= modes % WIDTH ? squares : 0.0) - s->part[SQUARES][a]) < 1e-12);
    }
    for (int32_t i = 0; i < lanes; i++)
        CHECK(columns[i * WIDTH + WIDTH - 1] == 0.0); /* past the last marker */
}

static void compare_shapes(int32_t modes)
{
    static shapes want, have;
    size_t const off = (size_t)modes % OFFSETS;
    run(isa_scalar(), modes, off, &want);
    check_sums(&want, modes);
    for (int k = -1; k < isa_count(); k++) {
        run(k < 0 ? isa_scalar() : isa_at(k), modes, off, &have);
        for (int p = 0; p < PARTS; p++)
            CHECK(guard_whole(&have.in[p]) && memcmp(have.part[p], want.part[p], have.in[p].bytes) == 0);
    }
}

int main(void)
{
    for (int32_t modes = 1; modes <= MOST_MODES; modes++)
        compare_shapes(modes);
    for (int32_t width = 1; width <= WIDEST; width++)
        for (int32_t modes = 0; modes <= MODES; modes++)
            compare(width, modes, width % MISALIGNED);
    return CHECK_DONE();
}
