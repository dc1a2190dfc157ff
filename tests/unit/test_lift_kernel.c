/* Positions by modes: every instruction set against the scalar definition, and that against the sum in order. */
#include "rng.h"

#include "check.h"
#include "kernel_check.h"

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

int main(void)
{
    for (int32_t width = 1; width <= WIDEST; width++)
        for (int32_t modes = 0; modes <= MODES; modes++)
            compare(width, modes, width % MISALIGNED);
    return CHECK_DONE();
}
