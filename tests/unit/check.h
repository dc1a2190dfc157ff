/* check.h - the unit-test framework: every failed CHECK is printed, main() ends with return CHECK_DONE(). */
#ifndef CHECK_H
#define CHECK_H
#include <math.h>
#include <stdio.h>
#include <string.h>

static int check_passed, check_failed;

#define CHECK(cond) check_that((cond) ? 1 : 0, #cond, __FILE__, __LINE__)
#define CHECK_NEAR(a, b, tol)                                                                                \
    check_near((double)(a), (double)(b), (double)(tol), #a " ~ " #b, __FILE__, __LINE__)
#define CHECK_DONE() check_done(__FILE__)

static inline void check_that(int ok, const char *what, const char *file, int line)
{
    check_passed += ok;
    check_failed += !ok;
    if (!ok)
        fprintf(stderr, "%s:%d: failed: %s\n", file, line, what);
}

static inline void check_near(double a, double b, double tol, const char *what, const char *file, int line)
{
    int const ok = fabs(a - b) <= tol;
    check_passed += ok;
    check_failed += !ok;
    if (!ok)
        fprintf(stderr, "%s:%d: failed: %s: %.9g against %.9g, tolerance %.3g\n", file, line, what, a, b,
                tol);
}

static inline int check_done(const char *file)
{
    const char *const base = strrchr(file, '/');
    printf("%-28s %6d passed, %d failed\n", base ? base + 1 : file, check_passed, check_failed);
    return check_failed != 0;
}
#endif
