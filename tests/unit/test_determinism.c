/* The same bits always: one golden digest, whatever the threads, the pieces, their order, the address, the instruction
 * set or a stop in between.
 *
 * With the argument `digest` it only prints `digest HAVE WANTED NAME` of both modes for each instruction set of this
 * CPU, for tests/check/golden.sh, which compares compilers and optimisation levels. */
#include "gait_pool.h"
#include "toy_film.h"

#include "check.h"

/* To refresh after a deliberate change of the tracker's numbers: run this test, read the lines it prints. */
#define GOLDEN       UINT64_C(0x18eba6ecbc43d8b3)
#define GOLDEN_PAPER UINT64_C(0xe11635656519bd4f)

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

/* The paper's mode: texture alone, a multinomial draw at every frame, random walks. */
static gait_tracker_config config_paper(void)
{
    gait_tracker_config cfg = config();
    cfg.mode = GAIT_MODE_PAPER;
    cfg.terms = GAIT_TERM_TEXTURE;
    cfg.resample_ess = 1.0f;
    cfg.evidence_time = cfg.mingle_time = cfg.tilt_time = cfg.coef_time = cfg.rate_time = 0.0f;
    cfg.offset_angles = 0;
    return cfg;
}

/* Masks of instruction sets: each of them alone, any together, none (scalar). */
enum { MASKS = (GAIT_CPU_BASE | GAIT_CPU_AVX2 | GAIT_CPU_AVX512) + 1 };

static uint64_t print_digest(gait_tracker_config cfg, uint32_t mask, uint64_t wanted, const char *mode)
{
    cfg.cpu_mask = mask;
    uint64_t const have = run(&cfg, 0);
    printf("digest %016llx %016llx %s-%s\n", (unsigned long long)have, (unsigned long long)wanted, mode,
           gait_cpu_name(mask));
    return have;
}

static int print_digests(void)
{
    for (uint32_t mask = 0; mask < MASKS; mask = 2 * mask + 1) {
        if (mask & ~gait_cpu_features())
            continue;
        print_digest(config(), mask, GOLDEN, "default");
        print_digest(config_paper(), mask, GOLDEN_PAPER, "paper");
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
        cfg.cpu_mask = (uint32_t)(tasks / 16 + tasks) % MASKS;
        CHECK(run(&cfg, tasks % 5 ? 0 : SAVE_AT) == GOLDEN);
        gait_pool_stop(pool);
    }
}

static void test_instruction_sets(void)
{
    for (uint32_t mask = 0; mask < MASKS; mask++) {
        gait_tracker_config cfg = config(), paper = config_paper();
        cfg.cpu_mask = paper.cpu_mask = mask;
        CHECK(run(&cfg, 0) == GOLDEN && run(&cfg, SAVE_AT) == GOLDEN);
        CHECK(run(&paper, mask & 1 ? SAVE_AT : 0) == GOLDEN_PAPER);
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
    _Static_assert(sizeof(gait_estimate) % 8 == 0, "hashed in words of 8 bytes");
    film_make(SCENE_CAMERAS, STEPS);
    if (argc > 1)
        return strcmp(argv[1], "digest") == 0 ? print_digests() : 2;
    CHECK(print_digest(config(), ~0u, GOLDEN, "default") == GOLDEN);
    CHECK(print_digest(config_paper(), ~0u, GOLDEN_PAPER, "paper") == GOLDEN_PAPER);
    test_instruction_sets();
    test_pieces_and_threads();
    test_order();
    test_another_seed();
    return CHECK_DONE();
}
