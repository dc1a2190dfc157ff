/* The number of particles can change while tracking, in the memory that was given. */
#include "gait_pool.h"
#include "toy_film.h"

#include "check.h"

enum { CAPACITY = 300, FEW = 100, SHOTS = 60 };

static gait_tracker_config config(int32_t particles)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = particles;
    return cfg;
}

static int32_t count(const gait_tracker *t)
{
    return gait_tracker_particles(t, NULL, NULL, 0, NULL);
}

static void test_refused(void)
{
    gait_tracker_config const cfg = config(CAPACITY);
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_error err = {0};
    CHECK(gait_tracker_set_particles(t, 15, &err) == GAIT_ERR_LIMIT && strstr(err.text, "300"));
    CHECK(gait_tracker_set_particles(t, CAPACITY + 1, NULL) == GAIT_ERR_LIMIT);
    CHECK(gait_tracker_set_particles(NULL, CAPACITY, NULL) == GAIT_ERR_ARG);
    toy_tracker_free(t);
}

static bool same(const gait_estimate *a, const gait_estimate *b)
{
    return memcmp(a, b, sizeof *a) == 0;
}

/* Fewer particles than the capacity give the bits of a tracker made for that number, lag included. */
static void test_a_larger_capacity_changes_nothing(void)
{
    gait_tracker_config const large = config(CAPACITY), small = config(FEW);
    gait_tracker *const a = film_tracker(&large, 0, 1.0f), *const b = film_tracker(&small, 0, 1.0f);
    CHECK(gait_tracker_set_particles(a, FEW, NULL) == GAIT_OK);
    toy_tracker_start(a, 0, 1.0f);
    for (int n = 0; n < 40; n++) {
        gait_estimate x, y;
        film_step(a, 1, n, n == 20, &x);
        film_step(b, 1, n, n == 20, &y);
        CHECK(same(&x, &y));
        int32_t const back = n < 5 ? n : 5;
        CHECK(gait_tracker_lagged(a, back, &x, NULL) == GAIT_OK);
        CHECK(gait_tracker_lagged(b, back, &y, NULL) == GAIT_OK && same(&x, &y));
    }
    CHECK(count(a) == FEW && count(b) == FEW);
    toy_tracker_free(a);
    toy_tracker_free(b);
}

static double off(const gait_estimate *e, int n)
{
    gait_state const truth = toy_walk((float)n / 30.0f);
    return fabs((double)e->mean.pelvis[0] - (double)truth.pelvis[0]);
}

static double total_weight(const gait_tracker *t)
{
    static gait_state state[CAPACITY];
    static float weight[CAPACITY];
    double sum = 0.0;
    int32_t const n = gait_tracker_particles(t, state, weight, CAPACITY, NULL);
    for (int32_t i = 0; i < n; i++)
        sum += (double)weight[i];
    return sum;
}

/* Another tracker that continues from this one, which is freed. */
static gait_tracker *saved_and_restored(gait_tracker *t, const gait_tracker_config *cfg)
{
    size_t bytes = 0;
    CHECK(gait_tracker_save(t, NULL, 0, &bytes, NULL) == GAIT_OK);
    unsigned char *const mem = malloc(bytes);
    CHECK(mem && gait_tracker_save(t, mem, bytes, &bytes, NULL) == GAIT_OK);
    toy_tracker_free(t);
    gait_tracker *const to = film_tracker(cfg, 3, 1.0f);
    CHECK(gait_tracker_restore(to, mem, bytes, NULL) == GAIT_OK);
    free(mem);
    return to;
}

/* 300, 40, 300: the person is tracked throughout, and the appearance learnt before the change is kept. */
static uint64_t follow(int32_t threads, bool store)
{
    static unsigned char memory[4096] __attribute__((aligned(GAIT_ALIGN)));
    gait_tracker_config cfg = config(CAPACITY);
    gait_pool *pool = NULL;
    CHECK(gait_pool_init(memory, sizeof memory, threads, &pool, NULL) == GAIT_OK);
    cfg.exec = gait_pool_tasks(pool);
    gait_tracker *t = film_tracker(&cfg, 0, 1.0f);
    for (int n = 0; n < SHOTS; n++) {
        gait_estimate e;
        int32_t const wanted = n < 10 || n >= 40 ? CAPACITY : 40;
        if (n == 10 || n == 40)
            CHECK(gait_tracker_set_particles(t, wanted, NULL) == GAIT_OK);
        film_step(t, 1, n, 0, &e);
        CHECK(count(t) == wanted);
        CHECK((e.flags & GAIT_EST_RESAMPLED) || (n != 10 && n != 40));
        CHECK_NEAR(total_weight(t), 1.0, 1e-4);
        CHECK(n < 5 || off(&e, n) < 0.1);
        if (n >= 10) {
            CHECK(gait_tracker_lagged(t, 5, &e, NULL) == GAIT_OK && off(&e, n - 5) < 0.1);
            CHECK(e.ess >= 1.0f && e.ess <= (float)CAPACITY);
        }
        if (store && n == 25) {
            t = saved_and_restored(t, &cfg);
            CHECK(count(t) == 40);
        }
    }
    uint64_t const digest = gait_tracker_digest(t);
    toy_tracker_free(t);
    gait_pool_stop(pool);
    return digest;
}

static void test_down_and_up(void)
{
    uint64_t const digest = follow(1, false);
    CHECK(follow(1, true) == digest);
    CHECK(follow(3, false) == digest);
}

/* While left and right are open the two hypotheses keep their particles. */
static void test_waits_while_split(void)
{
    gait_tracker_config const cfg = config(CAPACITY);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    gait_state const mean = toy_walk(0.0f);
    gait_state sd = toy_start_sd(1.0f);
    int waited = 0;
    sd.phase = 0.5f; /* unknown */
    CHECK(gait_tracker_start(t, &mean, &sd, toy_frame(0).utime, NULL) == GAIT_OK);
    for (int n = 0; n < SHOTS; n++) {
        gait_estimate e;
        film_step(t, 1, n, 0, &e);
        waited += n > 20 && count(t) == CAPACITY;
        CHECK_NEAR(total_weight(t), 1.0, 1e-4);
        if (n == 20) /* the hypotheses split after half a second */
            CHECK(gait_tracker_set_particles(t, 40, NULL) == GAIT_OK && count(t) == CAPACITY);
    }
    CHECK(waited > 3);
    toy_tracker_free(t);
}

/* Acquisition uses twice the number of particles that was set, which is kept through acquisition and a restore. */
static uint64_t search(int32_t store_at)
{
    gait_tracker_config cfg = config(CAPACITY);
    cfg.acquisition_particles = 2 * CAPACITY;
    gait_tracker *t = film_tracker(&cfg, 0, 1.0f);
    CHECK(gait_tracker_set_particles(t, FEW, NULL) == GAIT_OK);
    gait_state const mean = toy_walk(0.0f);
    gait_state sd = toy_start_sd(1.0f);
    sd.phase = 0.5f; /* unknown */
    CHECK(gait_tracker_start(t, &mean, &sd, toy_frame(0).utime, NULL) == GAIT_OK);
    for (int n = 0; n < SHOTS; n++) {
        gait_estimate e;
        film_step(t, 1, n, 0, &e);
        CHECK(count(t) == FEW || (n < SHOTS - 1 && count(t) == 2 * FEW));
        if (n == store_at)
            t = saved_and_restored(t, &cfg);
    }
    CHECK(count(t) == FEW);
    uint64_t const digest = gait_tracker_digest(t);
    toy_tracker_free(t);
    return digest;
}

static void test_search_restored(void)
{
    uint64_t const digest = search(-1);
    CHECK(search(5) == digest);
    CHECK(search(20) == digest);
}

int main(void)
{
    film_make(1, SHOTS);
    test_refused();
    test_a_larger_capacity_changes_nothing();
    test_down_and_up();
    test_waits_while_split();
    test_search_restored();
    return CHECK_DONE();
}
