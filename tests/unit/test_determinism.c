/* The same bits always: one golden digest, whatever the threads, the pieces, the address, the instruction set or a
 * stop in between.
 *
 * Prints `digest <hex>` for tests/check/golden.sh, which compares compilers and optimisation levels; with the argument
 * `digest` it does only that, with `digest MASK` for the instruction sets in MASK (GAIT_CPU_*). */
#include "toy_film.h"

#include "check.h"

#include <pthread.h>

/* To refresh after a deliberate change of the tracker's numbers: run this test, read the line it prints. */
#define GOLDEN UINT64_C(0x40b91a3f9300e7e7)

enum { STEPS = 50, SAVE_AT = 25 };

/* ---- threads ---- */
typedef struct crew {
    gait_task_fn *fn;
    void *ctx;
    int32_t count, next, threads;
    bool backwards;
    pthread_mutex_t lock;
} crew;

static void *work(void *arg)
{
    crew *const c = arg;
    for (;;) {
        pthread_mutex_lock(&c->lock);
        int32_t const i = c->next++;
        pthread_mutex_unlock(&c->lock);
        if (i >= c->count)
            return NULL;
        c->fn(c->ctx, c->backwards ? c->count - 1 - i : i);
    }
}

/* gait_tasks on as many threads as the crew has. */
static void run_crew(void *user, gait_task_fn *fn, void *ctx, int32_t count)
{
    crew *const c = user;
    pthread_t id[8];
    c->fn = fn;
    c->ctx = ctx;
    c->count = count;
    c->next = 0;
    for (int32_t k = 0; k < c->threads; k++)
        if (pthread_create(&id[k], NULL, work, c))
            abort();
    for (int32_t k = 0; k < c->threads; k++)
        pthread_join(id[k], NULL);
}

/* ---- one run ---- */
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

int main(int argc, char **argv)
{
    static const int32_t pieces[] = {1, 3, 64, 256};
    gait_tracker_config cfg = config();
    _Static_assert(sizeof(gait_estimate) % 8 == 0, "hashed in words of 8 bytes");
    film_make(SCENE_CAMERAS, STEPS);
    cfg.tasks = 8;
    if (argc > 2)
        cfg.cpu_mask = (uint32_t)strtoul(argv[2], NULL, 0);
    uint64_t const digest = run(&cfg, 0);
    printf("digest %016llx\n", (unsigned long long)digest);
    if (argc > 1)
        return strcmp(argv[1], "digest") != 0;
    CHECK(digest == GOLDEN);
    for (cfg.cpu_mask = 0; cfg.cpu_mask <= GAIT_CPU_AVX512; cfg.cpu_mask = 2 * cfg.cpu_mask + !cfg.cpu_mask)
        CHECK(run(&cfg, 0) == digest);
    cfg.cpu_mask = config().cpu_mask;
    for (size_t k = 0; k < sizeof pieces / sizeof *pieces; k++) {
        cfg.tasks = pieces[k];
        CHECK(run(&cfg, 0) == digest);
    }
    for (int32_t threads = 1; threads <= 8; threads++) {
        crew c = {.threads = threads, .backwards = threads == 4, .lock = PTHREAD_MUTEX_INITIALIZER};
        cfg.tasks = threads % 2 ? 16 : 5;
        cfg.exec = (gait_tasks){run_crew, &c};
        CHECK(run(&cfg, 0) == digest);
    }
    cfg = config();
    CHECK(run(&cfg, SAVE_AT) == digest);
    CHECK(run(&cfg, 41) == digest); /* right after a frame that nobody saw */
    cfg.seed++;
    CHECK(run(&cfg, 0) != digest);
    return CHECK_DONE();
}
