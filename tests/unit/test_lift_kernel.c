/* Positions by modes: every instruction set against the scalar definition, and that against the sum in order. */
#include "base/cholesky.h"
#include "base/rng.h"
#include "gait_lift.h"

#include "check.h"
#include "kernel_check.h"

#include <math.h>

enum { WIDEST = 75, MODES = GAIT_MAX_MODES, MISALIGNED = 4, NUMBERS = WIDEST + MISALIGNED };

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
    static double theta[MODES];
    double wrong = 0.0;
    size_t const stride = (size_t)(width + off);
    for (uint32_t i = 0; i < sizeof mode / sizeof *mode && theta[MODES - 1] == 0.0; i++) /* once */
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

/* ---- the kernels about the markers of a frame ---- */
enum {
    MOST_MODES = GAIT_MAX_MODES,
    MOST_LANES = MOST_MODES,
    EIGHT = CHOLESKY_LANES,
    APART = 16,
    WIDTH = 3 * APART,
    OFFSETS = 8
};
enum { SHAPE, MOVED, ROW, SHAPES, ALL_MOVED, SQUARES, PARTS };

typedef struct shapes { /* their outputs, each between canaries */
    _Alignas(64) unsigned char memory[PARTS][(3 * MOST_LANES * EIGHT + OFFSETS) * sizeof(double) + 2 * GUARD];
    _Alignas(64) unsigned char floats[(MOST_LANES * WIDTH + OFFSETS) * sizeof(float) + 2 * GUARD];
    guarded in[PARTS], turned_in;
    double *part[PARTS];
    float *turned; /* modes x WIDTH: three coordinates of the last eight of sixteen columns each */
} shapes;

static void clear(shapes *s, int32_t modes, size_t off)
{
    int32_t const lanes = cholesky_padded(modes);
    const int32_t numbers[PARTS] = {3 * lanes, 3, lanes, 3 * modes * EIGHT, 3 * EIGHT, WIDTH};
    for (int k = 0; k < PARTS; k++) {
        s->in[k] = guard_fill(s->memory[k] + off * sizeof(double), (size_t)numbers[k] * sizeof(double));
        memset(s->in[k].begin, 0, s->in[k].bytes);
        s->part[k] = (double *)(void *)s->in[k].begin;
    }
    s->turned_in = guard_fill(s->floats + off * sizeof(float), (size_t)(modes * WIDTH) * sizeof(float));
    memset(s->turned_in.begin, 0, s->turned_in.bytes);
    s->turned = (float *)(void *)s->turned_in.begin;
}

/* Mode i of a coordinate of marker r in a frame; marker 0 is the one that is made alone. */
static float mode_of(int32_t frame, int32_t a, int32_t i, int32_t r)
{
    return number((uint32_t)(((2 * r + frame) * 3 + a) * MOST_MODES + i));
}

static double theta_of(int32_t i)
{
    return (double)number(4000 + (uint32_t)i);
}

static double turn_of(int32_t a, int32_t i, int32_t r)
{
    return (double)number(5000 + (uint32_t)(9 * r + 3 * a + i));
}

/* Everything begins `off` numbers past an aligned place. */
static void run(const kernels *k, int32_t modes, size_t off, shapes *s)
{
    static _Alignas(64) float row[2][3 * MOST_LANES + OFFSETS], column[2][MOST_MODES * EIGHT + OFFSETS];
    static _Alignas(64) double theta[MOST_MODES + OFFSETS];
    int32_t const lanes = cholesky_padded(modes);
    double M[9][EIGHT], g[3];
    clear(s, modes, off);
    for (int32_t i = 0; i < modes; i++)
        theta[off + (size_t)i] = theta_of(i);
    for (int32_t i = 0; i < 9 * EIGHT; i++)
        M[i / EIGHT][i % EIGHT] = turn_of(i / EIGHT / 3, i / EIGHT % 3, i % EIGHT);
    for (int32_t a = 0; a < 3; a++) {
        g[a] = M[a][0];
        for (int32_t frame = 0; frame < 2; frame++) {
            for (int32_t i = 0; i < lanes; i++)
                row[frame][off + (size_t)(a * lanes + i)] = i < modes ? mode_of(frame, a, i, 0) : 0.0f;
            for (int32_t i = 0; i < modes * EIGHT; i++)
                column[frame][off + (size_t)i] = mode_of(frame, a, i / EIGHT, i % EIGHT);
        }
        k->lift_eight(s->part[SHAPES] + a * modes * EIGHT, column[0] + off, column[1] + off, 0.75, 0.25,
                      theta + off, modes, s->part[ALL_MOVED] + a * EIGHT);
    }
    k->lift_shape(s->part[SHAPE], row[0] + off, row[1] + off, 0.75, 0.25, lanes, theta + off, modes,
                  s->part[MOVED]);
    k->lift_row(s->part[ROW], s->part[SHAPE], lanes, g);
    k->lift_turn(s->turned + EIGHT, WIDTH, APART, s->part[SHAPES], modes, M);
    k->lift_squares(s->part[SQUARES], EIGHT * (1 + modes % (WIDTH / EIGHT)), s->turned, WIDTH, modes);
}

/* One marker as eight, and plain sums. */
static void check_sums(const shapes *s, int32_t modes)
{
    int32_t const lanes = cholesky_padded(modes), squared = EIGHT * (1 + modes % (WIDTH / EIGHT));
    for (int32_t a = 0; a < 3; a++)
        for (int32_t r = 0; r < EIGHT; r++) {
            int32_t const c = APART * a + EIGHT + r;
            double moved = 0.0, squares = 0.0;
            for (int32_t i = 0; i < modes; i++) {
                const double *const x = s->part[SHAPES] + i * EIGHT + r, *const y = x + modes * EIGHT;
                double const turned =
                    (turn_of(a, 0, r) * *x + turn_of(a, 1, r) * *y) + turn_of(a, 2, r) * y[modes * EIGHT];
                double const v = (double)s->turned[i * WIDTH + c];
                CHECK(s->turned[i * WIDTH + c] == (float)turned && s->turned[i * WIDTH + c - EIGHT] == 0.0f);
                CHECK(x[a * modes * EIGHT] ==
                      0.75 * (double)mode_of(0, a, i, r) + 0.25 * (double)mode_of(1, a, i, r));
                CHECK(r > 0 || x[a * modes * EIGHT] == s->part[SHAPE][a * lanes + i]);
                CHECK(r > 0 || a > 0 || turned == s->part[ROW][i]);
                moved += x[a * modes * EIGHT] * theta_of(i);
                squares += v * v;
            }
            CHECK(fabs(moved - s->part[ALL_MOVED][a * EIGHT + r]) < 1e-12);
            CHECK(r > 0 || fabs(moved - s->part[MOVED][a]) < 1e-12);
            CHECK(s->part[SQUARES][c] == (c < squared ? squares : 0.0));
        }
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
        CHECK(guard_whole(&have.turned_in) && memcmp(have.turned, want.turned, have.turned_in.bytes) == 0);
    }
}

int main(void)
{
    for (int32_t modes = 1; modes <= MOST_MODES; modes++)
        compare_shapes(modes);
    for (int32_t width = 1; width <= WIDEST; width++)
        for (int32_t modes = 0; modes <= MODES; modes += modes < 9 ? 1 : 37) /* the last is MODES */
            compare(width, modes, width % MISALIGNED);
    return CHECK_DONE();
}
