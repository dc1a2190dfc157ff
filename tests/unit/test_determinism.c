/* The same bits always: one golden digest, whatever the threads, the pieces, their order, the address, the instruction
 * set or a stop in between.
 *
 * With the argument `digest` it only prints `digest HEX ISA` for each instruction set of this CPU, for
 * tests/check/golden.sh, which compares compilers and optimisation levels. */
#include "gait_pool.h"
#include "toy_film.h"

#include "check.h"

/* To refresh after a deliberate change of the tracker's numbers: run this test, read the line it prints. */
#define GOLDEN UINT64_C(0x18eba6ecbc43d8b3)

/* Under a sanitizer, many times as slow, every 7th number of pieces must do: it still has threads from 1 to 16. */
#if defined(__has_feature)
#define SANITIZED __has_feature(address_sanitizer)
#elif defined(__SANITIZE_ADDRESS__)
#define SANITIZED 1
#else
#define SANITIZED 0
#endif

enum { STEPS = 50, SAVE_AT = 25, MOST_PIECES = 65, NEXT_PIECES = SANITIZED ? 7 : 1 };

/* gait_tasks that does the last piece first. */
static void run_backwards(void *user, gait_task_fn *fn, void *ctx, int32_t count)
{
    (void)user;
    while (count-- > 0)
        fn(ctx, count);
}

static gait_tracker_config config(void)
{
    gait_tracker_config cfg = toy_config(2);
    cfg.particles = 100; /* not a multiple of a block */
    cfg.offset_angles = GAIT_OFFSETS_TRUNK;
    return cfg;
}

/* Cameras that miss now and then, a gap, and the digest of all that was reported on the way. */
static uint64_t advance(gait_tracker *t, int from, int to, uint64_t hash)
{
    for (int n = from; n < to; n++) {
        gait_estimate e;
        if (n == 30 || n == 31)
            continue;
        film_step(t, 2, n, n % 9 == 4 ? 2u : n == 40 ? 3u : 0u, &e);
        uint32_t part[2];
        for (size_t i = 0; i < sizeof e; i += sizeof part) {
            memcpy(part, (const char *)&e + i, sizeof part);
            hash = (hash ^ part[0]) * UINT64_C(0x100000001b3);
            hash = (hash ^ part[1]) * UINT64_C(0x100000001b3);
        }
    }
    return hash;
}

/* Digest of 50 steps: state at the end and every estimate; save_at: saved, and continued by another tracker. */
static uint64_t run(const gait_tracker_config *cfg, int save_at)
{
    gait_tracker *t = film_tracker(cfg, 0, 1.0f);
    uint64_t hash = 0;
    if (save_at) {
        size_t bytes = 0;
        hash = advance(t, 0, save_at, hash);
        CHECK(gait_tracker_save(t, NULL, 0, &bytes) == GAIT_OK);
        unsigned char *const mem = malloc(bytes);
        CHECK(mem && gait_tracker_save(t, mem, bytes, &bytes) == GAIT_OK);
        toy_tracker_free(t);
        t = film_tracker(cfg, 7, 0.3f);
        CHECK(gait_tracker_restore(t, mem, bytes, NULL) == GAIT_OK);
        free(mem);
    }
    hash = advance(t, save_at, STEPS, hash);
    hash ^= gait_tracker_digest(t);
    toy_tracker_free(t);
    return hash;
}

/* Every instruction set of this CPU, lowest first: masks 0 (scalar), 1, 3, 7. */
static const uint32_t MASK[] = {0, GAIT_CPU_BASE, GAIT_CPU_BASE | GAIT_CPU_AVX2,
                                GAIT_CPU_BASE | GAIT_CPU_AVX2 | GAIT_CPU_AVX512};
enum { MASKS = sizeof MASK / sizeof *MASK };

static bool runs_here(uint32_t mask)
{
    return (mask & ~gait_cpu_features()) == 0;
}

static int print_digests(void)
{
    for (int k = 0; k < MASKS; k++) {
        gait_tracker_config cfg = config();
        cfg.cpu_mask = MASK[k];
        if (runs_here(MASK[k]))
            printf("digest %016llx %s\n", (unsigned long long)run(&cfg, 0), gait_cpu_name(MASK[k]));
    }
    return 0;
}

/* Pieces 1 .. 64 and more on 1 .. 16 threads; the instruction set and a stop in between change along. */
static void test_pieces_and_threads(void)
{
    static unsigned char memory[16384] __attribute__((aligned(GAIT_ALIGN)));
    for (int32_t tasks = MOST_PIECES; tasks > 0; tasks -= NEXT_PIECES) {
        gait_tracker_config cfg = config();
        gait_pool *pool = NULL;
        CHECK(gait_pool_init(memory, sizeof memory, 1 + (tasks - 1) % 16, &pool, NULL) == GAIT_OK);
        cfg.tasks = tasks <= 64 ? tasks : 256;
        cfg.exec = gait_pool_tasks(pool);
        cfg.cpu_mask = MASK[(tasks / 16 + tasks) % MASKS];
        CHECK(run(&cfg, tasks % 5 ? 0 : SAVE_AT) == GOLDEN);
        gait_pool_stop(pool);
    }
}

static void test_instruction_sets(void)
{
    for (int k = 0; k < MASKS; k++) {
        gait_tracker_config cfg = config();
        cfg.cpu_mask = MASK[k];
        CHECK(run(&cfg, 0) == GOLDEN && run(&cfg, SAVE_AT) == GOLDEN);
    }
}

static void test_order(void)
{
    gait_tracker_config cfg = config();
    cfg.exec.run = run_backwards;
    CHECK(run(&cfg, 0) == GOLDEN);
    CHECK(run(&cfg, 41) == GOLDEN); /* stopped right after a frame that nobody saw */
}

static void test_another_seed(void)
{
    gait_tracker_config cfg = config();
    cfg.seed++;
    CHECK(run(&cfg, 0) != GOLDEN);
}

int main(int argc, char **argv)
{
    gait_tracker_config const cfg = config();
    _Static_assert(sizeof(gait_estimate) % 8 == 0, "hashed in words of 8 bytes");
    film_make(SCENE_CAMERAS, STEPS);
    if (argc > 1)
        return strcmp(argv[1], "digest") == 0 ? print_digests() : 2;
    uint64_t const digest = run(&cfg, 0);
    printf("digest %016llx\n", (unsigned long long)digest);
    CHECK(digest == GOLDEN);
    test_instruction_sets();
    test_pieces_and_threads();
    test_order();
    test_another_seed();
    return CHECK_DONE();
}
