/* The tracker's memory: exactly what it asks for, aligned, and nothing beside it. */
#include "sanitized.h"
#include "toy_films.h"
#include "tracker/tracker.h"

#include "check.h"

enum { CANARY = 256, SHOTS = 6, WAY = 50, STEPS = (SANITIZED ? 4 : 8) * WAY };

static int intact(const unsigned char *p, int value)
{
    int same = 1;
    for (int i = 0; i < CANARY; i++)
        same &= p[i] == value;
    return same;
}

static size_t bytes_of(const gait_tracker_config *cfg)
{
    size_t bytes = 0;
    CHECK(gait_tracker_bytes(toy_model(), cfg, &bytes, NULL) == GAIT_OK);
    return bytes;
}

/* Too small by one, or misaligned: refused, with the required size in the error and nothing written. */
static void test_refused(void)
{
    gait_tracker_config const cfg = toy_config(1);
    size_t const need = bytes_of(&cfg);
    unsigned char *memory;
    gait_tracker *t = NULL;
    gait_error err = {0};
    char required[32];
    if (posix_memalign((void **)&memory, GAIT_ALIGN, need + GAIT_ALIGN))
        abort();
    memset(memory, 0xc3, need + GAIT_ALIGN);
    CHECK(gait_tracker_init(memory, need - 1, toy_model(), &cfg, &t, &err) == GAIT_ERR_MEMORY && !t);
    snprintf(required, sizeof required, "%zu", need);
    CHECK(strstr(err.text, required) && err.result == GAIT_ERR_MEMORY);
    CHECK(gait_tracker_init(memory, 0, toy_model(), &cfg, &t, NULL) == GAIT_ERR_MEMORY && !t);
    for (size_t off = 1; off < GAIT_ALIGN; off += 21)
        CHECK(gait_tracker_init(memory + off, need, toy_model(), &cfg, &t, NULL) == GAIT_ERR_MEMORY && !t);
    CHECK(gait_tracker_init(NULL, need, toy_model(), &cfg, &t, NULL) == GAIT_ERR_ARG && !t);
    CHECK(gait_tracker_init(memory, need, toy_model(), &cfg, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_init(memory, need, NULL, &cfg, &t, NULL) == GAIT_ERR_ARG && !t);
    CHECK(intact(memory, 0xc3) && intact(memory + need - CANARY, 0xc3));
    CHECK(gait_tracker_init(memory, need, toy_model(), &cfg, &t, &err) == GAIT_OK && t);
    free(memory);
}

/* An executor that runs the last task first, which finds all the work. */
static void run_backwards(void *user, void (*task)(void *ctx, int32_t index), void *ctx, int32_t count)
{
    (void)user;
    while (count-- > 0)
        task(ctx, count);
}

/* Fifty frames there and back, repeatedly from a start; now and then a camera or both miss.  Returns the stages
 * (bits) that left and right went through. */
static uint32_t walk(gait_tracker *t, const gait_tracker_config *cfg, int steps)
{
    uint32_t stages = 0;
    for (int n = 0; n < steps; n++) {
        int const at = n % (2 * WAY);
        uint32_t missing = n % 11 ? 0 : ~0u;
        for (int k = 0; k < cfg->cameras; k++)
            missing |= (n / 5 + k) % 4 ? 0 : 1u << k;
        if (at == 0)
            films_start(t, cfg, 0, 1.0f);
        gait_frame f = films_frame(cfg, at < WAY ? at : 2 * WAY - 1 - at, missing);
        gait_estimate e;
        f.utime = toy_frame(at).utime;
        CHECK(gait_tracker_step(t, &f, &e, NULL) == GAIT_OK);
        stages |= 1u << t->core->hypotheses.stage;
    }
    return stages;
}

/* A film in memory that was full of `fill`, between canaries; returns the digest at the end. */
static uint64_t walk_between_canaries(const gait_tracker_config *cfg, int fill, int steps)
{
    size_t const need = bytes_of(cfg);
    unsigned char *memory;
    gait_tracker *t = NULL;
    if (posix_memalign((void **)&memory, GAIT_ALIGN, need + 2 * CANARY))
        abort();
    memset(memory, fill, need + 2 * CANARY);
    CHECK(gait_tracker_init(memory + CANARY, need, toy_model(), cfg, &t, NULL) == GAIT_OK);
    uint32_t const stages = walk(t, cfg, steps);
    CHECK((stages >> HYPOTHESES_TWO & 1u) == (cfg->acquisition_particles > 0) &&
          stages >> HYPOTHESES_ONE & 1u);
    CHECK(intact(memory, fill) && intact(memory + CANARY + need, fill));
    uint64_t const digest = gait_tracker_digest(t);
    free(memory);
    return digest;
}

/* Four hundred steps of every film, 200 under a sanitizer, write nothing outside; whatever the memory's old contents, the
 * first hundred steps are the same. */
static void test_canaries(void)
{
    for (int film_kind = 0; film_kind < FILMS; film_kind++) {
        gait_tracker_config cfg = films_config(film_kind);
        cfg.particles = 33; /* not a multiple of a block */
        cfg.acquisition_particles = film_kind == FILMS_SEARCH ? 75 : 0;
        cfg.tasks = 5;
        cfg.exec.run = run_backwards;
        walk_between_canaries(&cfg, 0xc3, STEPS);
        CHECK(walk_between_canaries(&cfg, 0x5a, 2 * WAY) == walk_between_canaries(&cfg, 0xff, 2 * WAY));
    }
}

/* What tasks need and what lagged estimates need lies in one place: neither disturbs the other. */
static void test_tasks_and_lag(void)
{
    enum { LAG = 3 };
    gait_tracker_config cfg[2] = {toy_config(1), toy_config(1)};
    gait_tracker *t[2];
    cfg[1].exec.run = run_backwards;
    cfg[1].tasks = 3;
    for (int k = 0; k < 2; k++) {
        cfg[k].lag = LAG;
        t[k] = film_tracker(&cfg[k], 0, 1.0f);
    }
    for (int n = 0; n < SHOTS; n++) {
        gait_estimate now[2], then[2];
        memset(then, 0, sizeof then);
        for (int k = 0; k < 2; k++) {
            film_step(t[k], 1, n, 0, &now[k]);
            CHECK(n < LAG || gait_tracker_lagged(t[k], LAG, &then[k], NULL) == GAIT_OK);
        }
        CHECK(memcmp(&now[0], &now[1], sizeof now[0]) == 0 &&
              memcmp(&then[0], &then[1], sizeof then[0]) == 0);
    }
    CHECK(gait_tracker_digest(t[0]) == gait_tracker_digest(t[1]));
    for (int k = 0; k < 2; k++)
        toy_tracker_free(t[k]);
}

/* The size grows only with what is asked for; a start begins anew in the same memory. */
static void test_sizes(void)
{
    gait_tracker_config cfg = toy_config(1);
    size_t const base = bytes_of(&cfg);
    CHECK(base % GAIT_ALIGN == 0 && base < 8u << 20);
    cfg.particles = 600;
    size_t const more = bytes_of(&cfg);
    CHECK(more > base && more < base + 300 * 2048);
    cfg.particles = 300;
    cfg.cameras = 2;
    CHECK(bytes_of(&cfg) > base);
    cfg.cameras = 1;
    cfg.tasks = 5;
    CHECK(bytes_of(&cfg) == base); /* they do not run at once */
    cfg.exec.run = run_backwards;
    CHECK(bytes_of(&cfg) > base);
    cfg.tasks = 4;
    cfg.exec.run = NULL;
    cfg.terms = GAIT_TERM_EDGES;
    CHECK(bytes_of(&cfg) < base);
    cfg.terms = 0xf;
    cfg.seed = 99;
    CHECK(bytes_of(&cfg) == base);
    cfg.components = -1; /* all of the model's */
    CHECK(bytes_of(&cfg) == base);
    size_t bytes = 7;
    CHECK(gait_tracker_bytes(toy_model(), &cfg, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_bytes(NULL, &cfg, &bytes, NULL) == GAIT_ERR_ARG && bytes == 7);
    CHECK(gait_tracker_bytes(toy_model(), NULL, &bytes, NULL) == GAIT_ERR_ARG && bytes == 7);
}

static void test_restart(void)
{
    gait_tracker_config const cfg = toy_config(1);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    uint64_t digest[2];
    for (int round = 0; round < 2; round++) {
        toy_tracker_start(t, 0, 1.0f);
        for (int n = 0; n < SHOTS; n++) {
            gait_estimate e;
            film_step(t, 1, n, 0, &e);
        }
        digest[round] = gait_tracker_digest(t);
    }
    CHECK(digest[0] == digest[1]);
    toy_tracker_free(t);
}

int main(void)
{
    film_make(SCENE_CAMERAS, WAY);
    test_refused();
    test_canaries();
    test_sizes();
    test_tasks_and_lag();
    test_restart();
    return CHECK_DONE();
}
