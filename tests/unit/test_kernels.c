/* The choice of an instruction set, and the counting kernel in each of them. */
#include "kernel_check.h"

#include "image/features.h"
#include "base/rng.h"
#include "toy_visible.h"

#include "check.h"

/* ---- which one runs ---- */
static void test_choice(void)
{
    uint32_t const have = gait_cpu_features();
    CHECK(have & GAIT_CPU_BASE);
    CHECK(strcmp(gait_cpu_name(0), "scalar") == 0);
    CHECK(strcmp(gait_cpu_name(GAIT_CPU_BASE), "base") == 0);
    CHECK(strcmp(gait_cpu_name(GAIT_CPU_SSE4), have & GAIT_CPU_SSE4 ? "sse4" : "scalar") == 0);
    CHECK(strcmp(gait_cpu_name(GAIT_CPU_AVX2), have & GAIT_CPU_AVX2 ? "avx2" : "scalar") == 0);
    CHECK(strcmp(gait_cpu_name(GAIT_CPU_AVX512), have & GAIT_CPU_AVX512 ? "avx512" : "scalar") == 0);
    CHECK(gait_cpu_name(~0u) == gait_cpu_name(have));
    CHECK(kernels_choose(~have) == isa_scalar());
    for (int k = 0; k < isa_count(); k++) {
        CHECK(isa_at(k) != isa_scalar());
        CHECK(k == 0 || isa_at(k) != isa_at(k - 1));
    }
#if defined(__x86_64__) && defined(__GNUC__)
    /* The compiler's own support code asks the same questions. */
    __builtin_cpu_init();
    CHECK(!(have & GAIT_CPU_SSE4) == !(__builtin_cpu_supports("ssse3") && __builtin_cpu_supports("sse4.1") &&
                                       __builtin_cpu_supports("popcnt")));
    CHECK(!(have & GAIT_CPU_AVX2) == !(__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") &&
                                       __builtin_cpu_supports("popcnt") && __builtin_cpu_supports("bmi")));
    CHECK(!(have & GAIT_CPU_AVX512) ==
          !(__builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
            __builtin_cpu_supports("avx512vbmi") && __builtin_cpu_supports("avx512bitalg") &&
            __builtin_cpu_supports("avx512vpopcntdq")));
#endif
}

/* ---- counting ---- */
static uint64_t word(uint32_t index, uint32_t draw, uint32_t kind)
{
    uint32_t r[4];
    rng_bits(21, 0, 0, index, draw, r);
    uint64_t const v = (uint64_t)r[0] << 32 | r[1];
    return kind == 0 ? v : kind == 1 ? ~UINT64_C(0) : kind == 2 ? v & (0 - (uint64_t)(r[2] & 1u)) : 0;
}

static void test_silhouette_count(void)
{
    static uint64_t foreground[FOREGROUND_PLANES][GRID_SIZE][GRID_WORDS], inside[GRID_SIZE][GRID_WORDS];
    static uint64_t words[GRID_STARTS][FOREGROUND_PLANES + 1][GRID_SIZE];
    static grid_mask body;
    features f = {.foreground = foreground, .inside = inside, .words = words};
    for (uint32_t round = 0; round < 400; round++) {
        int32_t const first = (int32_t)(round * 37 % 128),
                      last = first + (int32_t)(round * 11 % 129) % (129 - first);
        int32_t area, covered, cells = 0, under = 0;
        for (uint32_t y = 0; y < GRID_SIZE; y++)
            for (uint32_t w = 0; w < GRID_WORDS; w++) {
                uint32_t const at = y * GRID_WORDS + w;
                body.word[w][y] = word(at, 10 * round, round % 3);
                inside[y][w] = word(at, 10 * round + 1, round / 3 % 4);
                for (uint32_t k = 0; k < FOREGROUND_PLANES; k++)
                    foreground[k][y][w] = word(at, 10 * round + 2 + k, round / 12 % 4);
            }
        body.first = round % 5 ? first : 0;
        body.last = round % 5 ? last : GRID_SIZE;
        body.width = round % 2 ? 64 : GRID_SIZE;
        body.column = round % 2 ? (int32_t)(round / 2 % 8 * GRID_STEP) : 0;
        features_words(&f);
        for (int32_t y = 0; y < GRID_SIZE; y++)
            for (int32_t x = 0; x < GRID_SIZE; x++) {
                uint64_t const bit = UINT64_C(1) << (x & 63);
                if (!toy_cell(&body, x, y) || !(inside[y][x >> 6] & bit))
                    continue;
                cells++;
                for (int32_t k = 0; k < FOREGROUND_PLANES; k++)
                    under += foreground[k][y][x >> 6] & bit ? 1 << k : 0;
            }
        isa_scalar()->silhouette_count(&f, &body, &area, &covered);
        CHECK(area == FOREGROUND_ONE * cells && covered == under);
        for (int k = 0; k < isa_count(); k++) {
            int32_t a = -1, c = -1;
            isa_at(k)->silhouette_count(&f, &body, &a, &c);
            CHECK(a == area && c == covered);
        }
    }
}

/* The guard of the other kernels' tests notices a byte too many on either side. */
static void test_guard(void)
{
    unsigned char memory[10 + 2 * GUARD];
    guarded g = guard_fill(memory, 10);
    memset(g.begin, 0, 10);
    CHECK(guard_whole(&g));
    g.begin[10] = 0;
    CHECK(!guard_whole(&g));
    g = guard_fill(memory, 10);
    g.begin[-1] = 0;
    CHECK(!guard_whole(&g));
}

int main(void)
{
    test_choice();
    test_silhouette_count();
    test_guard();
    return CHECK_DONE();
}
