#include "base/arena.h"

#include "check.h"

typedef struct layout {
    double *a;
    char *b;
    float *c;
} layout;

static layout place(arena *a)
{
    return (layout){.a = TAKE(a, double, 3), .b = TAKE(a, char, 65), .c = TAKE(a, float, 16)};
}

static void test_two_passes(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char mem[1024];
    arena count = {.base = NULL};
    layout const none = place(&count);
    CHECK(!none.a && !none.b && !none.c && !count.overflow);
    CHECK(count.used >= 24 + 65 + 64 && count.used % GAIT_ALIGN == 0 && count.used <= sizeof mem);

    arena exact = {.base = mem, .cap = count.used};
    layout const l = place(&exact);
    CHECK(!exact.overflow && exact.used == count.used);
    CHECK((void *)l.a == mem && (unsigned char *)l.b >= mem + 64 && (unsigned char *)l.c >= mem + 64 + 128);
    CHECK((uintptr_t)l.b % GAIT_ALIGN == 0 && (uintptr_t)l.c % GAIT_ALIGN == 0);
    memset(l.a, 1, 24);
    memset(l.b, 2, 65);
    memset(l.c, 3, 64);

    arena small = {.base = mem, .cap = count.used - 1};
    layout const cut = place(&small);
    CHECK(small.overflow && cut.a && cut.b && !cut.c);
    CHECK(!arena_take(&small, 1, 1) && small.used <= small.cap);
}

static void test_overflow(void)
{
    static const size_t elem[] = {2, SIZE_MAX, SIZE_MAX, 64, 1};
    static const size_t count[] = {SIZE_MAX / 2 + 1, SIZE_MAX, 1, SIZE_MAX / 64 + 1, SIZE_MAX - 10};
    for (size_t i = 0; i < sizeof elem / sizeof *elem; i++) {
        arena a = {.base = NULL};
        CHECK(!arena_take(&a, elem[i], count[i]) && a.overflow);
        CHECK(!arena_take(&a, 1, 1) && a.overflow && a.used == 0);
    }
    arena sum = {.base = NULL};
    arena_take(&sum, 1, SIZE_MAX / 2);
    arena_take(&sum, 1, SIZE_MAX / 2);
    CHECK(sum.overflow);
    arena negative = {.base = NULL};
    CHECK(!TAKE(&negative, float, -1) && negative.overflow);
}

static void test_empty(void)
{
    static _Alignas(GAIT_ALIGN) unsigned char mem[256];
    arena a = {.base = mem, .cap = sizeof mem};
    CHECK(TAKE(&a, double, 0) && !a.overflow);
}

int main(void)
{
    test_two_passes();
    test_overflow();
    test_empty();
    return CHECK_DONE();
}
