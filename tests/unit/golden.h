/* golden.h - digests for tests/check/golden.sh, which compares compilers and optimisation levels.
 *
 * Prints `digest HAVE WANTED NAME` for each instruction set of this CPU, and `skipped SET` for each that it does not have:
 * one line for every set, so that golden.sh knows how many to expect. */
#ifndef GOLDEN_H
#define GOLDEN_H
#include "gait.h"

#include "check.h"

#include <stdint.h>

static inline uint64_t golden_line(uint64_t have, uint64_t wanted, const char *name, const char *set)
{
    printf("digest %016llx %016llx %s-%s\n", (unsigned long long)have, (unsigned long long)wanted, name, set);
    return have;
}

/* Print a line for the digest with each mask (GAIT_CPU_*); returns how many digests differ from the wanted one. */
static inline int golden_print(uint64_t (*digest)(uint32_t mask), uint64_t wanted, const char *name)
{
    static const struct {
        uint32_t mask;
        const char *name;
    } set[] = {{0, "scalar"},
               {GAIT_CPU_BASE, "base"},
               {GAIT_CPU_BASE | GAIT_CPU_SSE4, "sse4"},
               {GAIT_CPU_BASE | GAIT_CPU_AVX2, "avx2"},
               {GAIT_CPU_BASE | GAIT_CPU_AVX2 | GAIT_CPU_AVX512, "avx512"}};
    int wrong = 0;
    for (size_t k = 0; k < sizeof set / sizeof *set; k++)
        if (set[k].mask & ~gait_cpu_features())
            printf("skipped %s\n", set[k].name);
        else
            wrong += golden_line(digest(set[k].mask), wanted, name, set[k].name) != wanted;
    return wrong;
}

/* main() of a test with one digest: runs all its tests and compares every mask; with the argument `digest` it only prints
 * the lines. */
static inline int golden_main(int argc, char **argv, void (*tests)(void), uint64_t (*digest)(uint32_t mask),
                              uint64_t wanted, const char *name)
{
    if (argc == 2)
        return strcmp(argv[1], "digest") == 0 ? (golden_print(digest, wanted, name) + check_failed) != 0 : 2;
    tests();
    for (uint32_t mask = 0; mask <= (GAIT_CPU_BASE | GAIT_CPU_SSE4 | GAIT_CPU_AVX2 | GAIT_CPU_AVX512); mask++)
        CHECK(digest(mask) == wanted);
    CHECK(golden_line(digest(~0u), wanted, name, "best") == wanted);
    return check_done(argv[0]);
}
#endif
