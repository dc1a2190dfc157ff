/* Positions by modes: every instruction set against the scalar definition, and that against the sum in order. */
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

enum { MOST_MODES = 19, LANES = 24, MARKERS = 5, WIDTH = 3 * MARKERS + 1 };

typedef struct shapes { /* what the kernels about one marker make */
    double shape[3 * LANES], moved[3], row[LANES], columns[LANES * WIDTH], squares[WIDTH];
    float about[LANES * WIDTH]; /* columns */
} shapes;

static void run(const kernels *k, int32_t modes, shapes *s)
{
    float mode[2][3 * LANES];
    double theta[MOST_MODES], M[3][3];
    for (uint32_t i = 0; i < 3 * LANES; i++) {
        bool const used = (int32_t)(i % LANES) < modes;
        mode[0][i] = used ? number(i) : 0.0f;
        mode[1][i] = used ? number(200 + i) : 0.0f;
    }
    for (uint32_t i = 0; i < MOST_MODES; i++)
        theta[i] = (double)number(400 + i);
    for (uint32_t i = 0; i < 9; i++)
        M[i / 3][i % 3] = (double)number(600 + i);
    memset(s, 0, sizeof *s);
    k->lift_shape(s->shape, mode[0], mode[1], 0.75, 0.25, LANES, theta, modes, s->moved);
    k->lift_row(s->row, s->shape, LANES, M[0]);
    for (int32_t r = 0; r < MARKERS; r++)
        k->lift_columns(s->columns + 3 * r, WIDTH, s->shape, LANES, M);
    for (int32_t i = 0; i < LANES * WIDTH; i++)
        s->about[i] = (float)s->columns[i];
    k->lift_squares(s->squares, WIDTH, s->about, WIDTH, modes);
}

/* One marker's modes: against sums in plain order, and every instruction set against the scalar one. */
static void compare_shapes(int32_t modes)
{
    static shapes want, have;
    run(isa_scalar(), modes, &want);
    for (int32_t a = 0; a < 3; a++) {
        double moved = 0.0, squares = 0.0;
        for (int32_t i = 0; i < modes; i++) {
            double const column = want.columns[i * WIDTH + a], about = (double)want.about[i * WIDTH + a];
            moved += want.shape[a * LANES + i] * (double)number(400 + (uint32_t)i);
            squares += about * about;
            CHECK(column == want.columns[i * WIDTH + 3 * (MARKERS - 1) + a]);
            CHECK(a > 0 || column == want.row[i]);
        }
        CHECK(fabs(moved - want.moved[a]) < 1e-12 && fabs(squares - want.squares[a]) < 1e-12);
    }
    for (int32_t i = 0; i < modes; i++)
        CHECK(want.columns[i * WIDTH + WIDTH - 1] == 0.0); /* past the last marker */
    for (int k = 0; k < isa_count(); k++) {
        run(isa_at(k), modes, &have);
        CHECK(memcmp(&have, &want, sizeof have) == 0);
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
