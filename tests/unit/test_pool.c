/* The pool calls every task once with any number of threads and returns after the last; the caller owns the memory. */
#include "gait_pool.h"

#include "check.h"

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>

enum { TASKS = 257, ROUNDS = 300, CANARY = 64 };

typedef struct crew {
    unsigned char *memory; /* a canary on either side */
    size_t bytes;
    gait_pool *pool;
} crew;

static crew start(int32_t threads)
{
    crew c = {0};
    CHECK(gait_pool_bytes(threads, &c.bytes, NULL) == GAIT_OK);
    c.memory = aligned_alloc(GAIT_ALIGN, c.bytes + 2 * CANARY);
    if (!c.memory)
        abort();
    memset(c.memory, 0xa5, c.bytes + 2 * CANARY);
    CHECK(gait_pool_init(c.memory + CANARY, c.bytes, threads, &c.pool, NULL) == GAIT_OK);
    return c;
}

static void finish(crew *c)
{
    int whole = 1;
    gait_pool_stop(c->pool);
    for (size_t i = 0; i < CANARY; i++)
        whole &= c->memory[i] == 0xa5 && c->memory[CANARY + c->bytes + i] == 0xa5;
    CHECK(whole);
    free(c->memory);
}

static int calls[TASKS];

static void count(void *ctx, int32_t task)
{
    int *const round = ctx;
    calls[task] += *round; /* without a lock, since a task runs on one thread; a second call would show */
}

static void test_every_task_once(int32_t threads)
{
    crew c = start(threads);
    gait_tasks const tasks = gait_pool_tasks(c.pool);
    int expected = 0, exact = 1;
    memset(calls, 0, sizeof calls);
    CHECK((tasks.run == NULL) == (threads == 1));
    for (int round = 1; tasks.run && round <= ROUNDS; round++) {
        int32_t const n = round % 3 == 0 ? 1 : round % 7 == 0 ? 0 : TASKS;
        tasks.run(tasks.user, count, &round, n);
        for (int i = 0; i < n; i++) {
            exact &= calls[i] == (i ? round : expected + round);
            calls[i] -= i ? round : 0;
        }
        expected += n ? round : 0;
    }
    CHECK(exact && calls[0] == expected);
    for (int i = 1; i < TASKS; i++)
        CHECK(calls[i] == 0);
    finish(&c);
}

/* Pools side by side and one after the other in the same memory. */
static void test_two_pools(void)
{
    crew a = start(3), b = start(2);
    int round = 1;
    memset(calls, 0, sizeof calls);
    for (int k = 0; k < 50; k++) {
        gait_tasks const t = gait_pool_tasks(k % 2 ? a.pool : b.pool);
        t.run(t.user, count, &round, TASKS);
    }
    gait_pool_stop(a.pool);
    CHECK(gait_pool_init(a.memory + CANARY, a.bytes, 3, &a.pool, NULL) == GAIT_OK);
    gait_tasks const t = gait_pool_tasks(a.pool);
    t.run(t.user, count, &round, TASKS);
    CHECK(calls[0] == 51 && calls[TASKS - 1] == 51);
    finish(&a);
    finish(&b);
}

static void test_refused(void)
{
    size_t bytes = 7;
    gait_pool *p = NULL;
    gait_error err = {0};
    CHECK(gait_pool_bytes(0, &bytes, &err) == GAIT_ERR_LIMIT && err.text[0]);
    CHECK(gait_pool_bytes(GAIT_POOL_MAX + 1, &bytes, NULL) == GAIT_ERR_LIMIT && bytes == 7);
    CHECK(gait_pool_bytes(2, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_pool_bytes(2, &bytes, NULL) == GAIT_OK && bytes > 7);
    unsigned char *const mem = aligned_alloc(GAIT_ALIGN, bytes + GAIT_ALIGN);
    if (!mem)
        abort();
    CHECK(gait_pool_init(mem, bytes - 1, 2, &p, &err) == GAIT_ERR_MEMORY && !p);
    CHECK(gait_pool_init(mem + 8, bytes, 2, &p, NULL) == GAIT_ERR_MEMORY && !p);
    CHECK(gait_pool_init(NULL, bytes, 2, &p, NULL) == GAIT_ERR_ARG && !p);
    CHECK(gait_pool_init(mem, bytes, 2, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_pool_init(mem, bytes, 0, &p, NULL) == GAIT_ERR_LIMIT && !p);
    CHECK(gait_pool_tasks(NULL).run == NULL);
    gait_pool_stop(NULL);
    free(mem);
}

typedef struct meeting {
    pthread_barrier_t both;
    int open[2]; /* does the task's thread take SIGTERM? */
} meeting;

static void check_other(void *ctx, int32_t task)
{
    meeting *const m = ctx;
    sigset_t now;
    pthread_barrier_wait(&m->both);
    pthread_sigmask(SIG_SETMASK, NULL, &now);
    m->open[task] = !sigismember(&now, SIGTERM);
}

/* Signals are for the caller's thread: of two tasks that wait for each other one is the helper's. */
static void test_signals(void)
{
    crew c = start(2);
    gait_tasks const tasks = gait_pool_tasks(c.pool);
    meeting m = {.open = {0}};
    pthread_barrier_init(&m.both, NULL, 2);
    for (int round = 0; round < 20; round++) {
        tasks.run(tasks.user, check_other, &m, 2);
        CHECK(m.open[0] + m.open[1] == 1);
    }
    pthread_barrier_destroy(&m.both);
    finish(&c);
}

int main(void)
{
    for (int32_t threads = 1; threads <= 8; threads++)
        test_every_task_once(threads);
    test_every_task_once(64);
    test_two_pools();
    test_refused();
    test_signals();
    return CHECK_DONE();
}
