/* The bits are always the same: one golden digest for any threads, tasks and order of tasks, any address and instruction
 * set, and with a snapshot in between.
 *
 * With the argument `digest` it only prints those of every film (golden.h). */
#include "gait_pool.h"
#include "golden.h"
#include "sanitized.h"
#include "toy_films.h"
#include "tracker/tracker.h"

#include "check.h"

/* To update after a deliberate change of the tracker's numbers, run this test and read the lines it prints. */
#define GOLDEN        UINT64_C(0xe89ee3a1309d8e5f)
#define GOLDEN_PAPER  UINT64_C(0x451bc1b7be892b57)
#define GOLDEN_GIVEN  UINT64_C(0xc89a612666cfae64)
#define GOLDEN_SEARCH UINT64_C(0x1e30e81c4d9e5a66)

/* Of 50 frames two are never sent: 48 steps. */
enum { SHOTS = 50, GAP = 30, GAP_END = 32, SAVE_AT = 25 };

/* Under a sanitizer, many times as slow, every 2nd or 3rd number of threads must do; under that of threads nothing else. */
enum { MOST_THREADS = 16, NEXT_THREADS = THREADS_WATCHED ? 3 : SANITIZED ? 2 : 1 };

/* gait_tasks that runs the last task first. */
static void run_backwards(void *user, gait_task_fn *fn, void *ctx, int32_t count)
{
    (void)user;
    while (count-- > 0)
        fn(ctx, count);
}

static gait_tracker *start(const gait_tracker_config *cfg, int n, float factor)
{
    gait_tracker *const t = toy_tracker_new(cfg);
    films_start(t, cfg, n, factor);
    return t;
}

/* ---- digests ---- */
/* Hash of numbers of 4 bytes each from a part of an estimate. */
static uint64_t hash_part(const gait_estimate *e, size_t begin, size_t end, uint64_t hash)
{
    for (size_t i = begin; i < end; i += 4) {
        uint32_t part;
        memcpy(&part, (const char *)e + i, sizeof part);
        hash = (hash ^ part) * UINT64_C(0x100000001b3);
    }
    return hash;
}

/* Hash everything that is reported except the classes of motion, of which there is one. */
static uint64_t hash_estimate(const gait_estimate *e, uint64_t hash)
{
    size_t const state[] = {offsetof(gait_estimate, mean), offsetof(gait_estimate, sd),
                            offsetof(gait_estimate, best)};
    hash = hash_part(e, 0, state[0], hash);
    for (int k = 0; k < 3; k++)
        hash = hash_part(e, state[k], state[k] + offsetof(gait_state, motion_class), hash);
    CHECK(e->motion_class == 0 && e->class_probability[0] == 1.0f && e->class_probability[1] == 0.0f);
    return hash_part(e, state[2] + sizeof(gait_state), offsetof(gait_estimate, motion_class), hash);
}

/* Steps of frames from .. to: cameras miss now and then, a gap; the digest of all that was reported on the way. */
static uint64_t advance(const gait_tracker_config *cfg, gait_tracker *t, int from, int to, uint64_t hash)
{
    for (int n = from; n < to; n++) {
        uint32_t const missing = n % 9 == 4 ? 2u : n == 40 ? 3u : 0u;
        gait_estimate e;
        if (n >= GAP && n < GAP_END)
            continue;
        gait_frame const f = films_frame(cfg, n, missing);
        CHECK(gait_tracker_step(t, &f, &e, NULL) == GAIT_OK);
        hash = hash_estimate(&e, hash);
    }
    return hash;
}

/* Digest of so many frames: of all estimates and of the state at the end.  save_at: step at which another tracker
 * continues from a snapshot. */
static uint64_t run_frames(const gait_tracker_config *cfg, int save_at, int frames)
{
    gait_tracker *t = start(cfg, 0, 1.0f);
    uint64_t hash = 0;
    if (save_at) {
        size_t bytes = 0;
        hash = advance(cfg, t, 0, save_at, hash);
        CHECK(gait_tracker_save(t, NULL, 0, &bytes, NULL) == GAIT_OK);
        unsigned char *const mem = malloc(bytes);
        CHECK(mem && gait_tracker_save(t, mem, bytes, &bytes, NULL) == GAIT_OK);
        toy_tracker_free(t);
        t = start(cfg, 7, 0.3f);
        CHECK(gait_tracker_restore(t, mem, bytes, NULL) == GAIT_OK);
        free(mem);
    }
    hash = advance(cfg, t, save_at, frames, hash);
    hash ^= gait_tracker_digest(t);
    toy_tracker_free(t);
    return hash;
}

static uint64_t run(const gait_tracker_config *cfg, int save_at)
{
    return run_frames(cfg, save_at, SHOTS);
}

/* Masks of instruction sets: each of them alone, any together, none (scalar). */
enum { MASKS = (GAIT_CPU_BASE | GAIT_CPU_SSE4 | GAIT_CPU_AVX2 | GAIT_CPU_AVX512) + 1 };

static uint64_t masked(gait_tracker_config cfg, uint32_t mask)
{
    cfg.cpu_mask = mask;
    return run(&cfg, 0);
}

static uint64_t digest_usual(uint32_t mask)
{
    return masked(films_config(FILMS_USUAL), mask);
}

static uint64_t digest_paper(uint32_t mask)
{
    return masked(films_config(FILMS_PAPER), mask);
}

static uint64_t digest_given(uint32_t mask)
{
    return masked(films_config(FILMS_GIVEN), mask);
}

static uint64_t digest_search(uint32_t mask)
{
    return masked(films_config(FILMS_SEARCH), mask);
}

static int print_digests(void)
{
    return golden_print(digest_usual, GOLDEN, "default") + golden_print(digest_paper, GOLDEN_PAPER, "paper") +
           golden_print(digest_given, GOLDEN_GIVEN, "given") +
           golden_print(digest_search, GOLDEN_SEARCH, "search");
}

/* FILMS_SEARCH goes through all stages: acquisition with more particles, two hypotheses, one of them dropped. */
static void test_search_is_decided(void)
{
    gait_tracker_config const cfg = films_config(FILMS_SEARCH);
    gait_tracker *const t = start(&cfg, 0, 1.0f);
    advance(&cfg, t, 0, SAVE_AT, 0);
    CHECK(t->core->hypotheses.stage == HYPOTHESES_TWO && t->cfg.particles == cfg.acquisition_particles);
    advance(&cfg, t, SAVE_AT, SHOTS, 0);
    CHECK(t->core->hypotheses.stage == HYPOTHESES_ONE && t->cfg.particles == cfg.particles);
    toy_tracker_free(t);
}

/* Fewer and more tasks than the seven blocks of particles, on 1 .. 16 threads, with varying instruction sets and
 * snapshots. */
static void test_pieces_and_threads(void)
{
    static const int32_t pieces[MOST_THREADS] = {256, 7, 2, 8, 5, 3, 64, 4, 1, 6, 9, 33, 16, 2, 48, 7};
    static unsigned char memory[16384] __attribute__((aligned(GAIT_ALIGN)));
    for (int32_t threads = MOST_THREADS; threads > 0; threads -= NEXT_THREADS) {
        gait_tracker_config cfg = films_config(FILMS_USUAL);
        gait_pool *pool = NULL;
        CHECK(gait_pool_init(memory, sizeof memory, threads, &pool, NULL) == GAIT_OK);
        cfg.tasks = pieces[threads - 1];
        cfg.exec = gait_pool_tasks(pool);
        cfg.cpu_mask = (uint32_t)threads % MASKS;
        CHECK(run(&cfg, threads % 5 ? 0 : SAVE_AT) == GOLDEN);
        cfg.acquisition_particles = 2 * cfg.particles;
        CHECK(threads % 4 != 3 || run(&cfg, threads % 8 == 3 ? 0 : SAVE_AT) == GOLDEN_SEARCH);
        gait_pool_stop(pool);
    }
}

/* More blocks, 69, than some numbers of tasks, so that 7 .. 256 tasks divide them differently. */
static void test_a_crowd_in_pieces(void)
{
    static const int32_t pieces[][2] = {{2, 2},   {5, 3},  {16, 4}, {23, 1},
                                        {64, 16}, {68, 5}, {69, 2}, {256, 3}};
    static unsigned char memory[16384] __attribute__((aligned(GAIT_ALIGN)));
    enum { CROWD = 1099, CROWD_SHOTS = SANITIZED || THREADS_WATCHED ? 4 : 12 };
    gait_tracker_config cfg = films_config(FILMS_USUAL);
    cfg.particles = CROWD;
    cfg.tasks = 1;
    uint64_t const alone = run_frames(&cfg, 0, CROWD_SHOTS);
    for (size_t k = 0; k < sizeof pieces / sizeof *pieces; k++) {
        gait_pool *pool = NULL;
        CHECK(gait_pool_init(memory, sizeof memory, pieces[k][1], &pool, NULL) == GAIT_OK);
        cfg.tasks = pieces[k][0];
        cfg.exec = gait_pool_tasks(pool);
        CHECK(run_frames(&cfg, k % 3 ? 0 : CROWD_SHOTS / 2, CROWD_SHOTS) == alone);
        gait_pool_stop(pool);
    }
}

/* How many generations are kept changes no estimate. */
static void test_no_lag(void)
{
    for (int film_kind = 0; film_kind < FILMS; film_kind++) {
        gait_tracker_config cfg = films_config(film_kind);
        uint64_t hash[3];
        for (int lag = 0; lag < 3; lag++) {
            cfg.lag = lag;
            gait_tracker *const t = start(&cfg, 0, 1.0f);
            hash[lag] = advance(&cfg, t, 0, SHOTS, 0);
            toy_tracker_free(t);
        }
        CHECK(hash[0] == hash[1] && hash[0] == hash[2]);
    }
}

/* Each instruction set alone with every film; of several the best one is used, which one film suffices to show. */
static void test_instruction_sets(void)
{
    for (uint32_t mask = 0; mask < MASKS; mask++) {
        gait_tracker_config cfg = films_config(FILMS_USUAL), paper = films_config(FILMS_PAPER),
                            given = films_config(FILMS_GIVEN), search = films_config(FILMS_SEARCH);
        cfg.cpu_mask = paper.cpu_mask = given.cpu_mask = search.cpu_mask = mask;
        given.tasks = 1 + (int32_t)mask;
        CHECK(run(&cfg, mask & 1 ? SAVE_AT : 0) == GOLDEN);
        if (mask & (mask - 1))
            continue;
        CHECK(run(&search, mask & 1 ? SAVE_AT : 0) == GOLDEN_SEARCH);
        CHECK(run(&given, mask & 1 ? 0 : SAVE_AT) == GOLDEN_GIVEN);
        CHECK(run(&paper, mask & 1 ? SAVE_AT : 0) == GOLDEN_PAPER);
    }
}

static void test_order(void)
{
    gait_tracker_config cfg = films_config(FILMS_USUAL);
    cfg.exec.run = run_backwards;
    CHECK(run(&cfg, 0) == GOLDEN);
    CHECK(run(&cfg, 41) == GOLDEN); /* stopped right after a frame without an image */
}

static void test_another_seed(void)
{
    gait_tracker_config cfg = films_config(FILMS_USUAL);
    cfg.seed++;
    CHECK(run(&cfg, 0) != GOLDEN);
}

int main(int argc, char **argv)
{
    film_make(SCENE_CAMERAS, SHOTS);
    if (argc > 1)
        return strcmp(argv[1], "digest") == 0 ? (print_digests() + check_failed) != 0 : 2;
    CHECK(golden_line(digest_usual(~0u), GOLDEN, "default", "best") == GOLDEN);
    CHECK(golden_line(digest_paper(~0u), GOLDEN_PAPER, "paper", "best") == GOLDEN_PAPER);
    CHECK(golden_line(digest_given(~0u), GOLDEN_GIVEN, "given", "best") == GOLDEN_GIVEN);
    CHECK(golden_line(digest_search(~0u), GOLDEN_SEARCH, "search", "best") == GOLDEN_SEARCH);
    test_search_is_decided();
    test_pieces_and_threads();
    test_a_crowd_in_pieces();
    if (!THREADS_WATCHED) {
        test_instruction_sets();
        test_no_lag();
        test_order();
        test_another_seed();
    }
    return CHECK_DONE();
}
