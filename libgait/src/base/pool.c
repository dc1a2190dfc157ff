/* pool.c - runs tasks on POSIX threads: each free thread takes the next task. A thread that has to wait
 * spins for a while before it sleeps, because the jobs of a step follow one another closely and waking a
 * thread takes as long as some of them. */
#ifndef GAIT_NO_THREADS
#define _POSIX_C_SOURCE 200809L
#endif
#include "gait_pool.h"
#include "base/arena.h"

#ifndef GAIT_NO_THREADS
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <string.h>

#ifdef OLDEST_GLIBC /* for wheels: glibc 2.32 and 2.34 moved these from libpthread to libc, with new versions */
__asm__(".symver pthread_create, pthread_create@" OLDEST_GLIBC);
__asm__(".symver pthread_join, pthread_join@" OLDEST_GLIBC);
__asm__(".symver pthread_sigmask, pthread_sigmask@" OLDEST_GLIBC);
#endif

typedef struct job {
    gait_task_fn *fn; /* NULL: none */
    void *ctx;
    int32_t count;
} job;

struct gait_pool {
    pthread_mutex_t lock; /* protects everything but `next`; `number` and `busy` may be read without it */
    pthread_cond_t work, done;
    pthread_t *thread; /* helpers; the caller of a job works as well */
    int32_t helpers;
    bool quit;
    job now;
    atomic_uint number; /* of the job */
    atomic_uint busy;   /* helpers that work on it */
    atomic_int next;    /* next task to hand out */
};

enum { SPINS = 20000 }; /* 0.4 to 0.5 ms, shared among all helpers: there may be more of them than cores */

/* Spin while (*value == known) == same, for a limited time. */
static void spin_while(const gait_pool *p, const atomic_uint *value, unsigned known, bool same)
{
    int32_t left = SPINS / i_max(p->helpers, 1);
    while (left-- > 0 && (atomic_load_explicit(value, memory_order_relaxed) == known) == same)
#if defined(__x86_64__)
        __builtin_ia32_pause();
#elif defined(__aarch64__)
        __asm__ volatile("isb" ::: "memory"); /* waits about as long as the pause of x86 */
#else
        continue;
#endif
}

static void work_off(gait_pool *p, const job *j)
{
    for (int32_t task; (task = atomic_fetch_add(&p->next, 1)) < j->count;)
        j->fn(j->ctx, task);
}

static void *helper(void *arg)
{
    gait_pool *const p = arg;
    unsigned last = 0;
    bool fresh = false; /* just finished a job, so the next one may be near */
    pthread_mutex_lock(&p->lock);
    while (!p->quit) {
        if (fresh) {
            fresh = false;
            pthread_mutex_unlock(&p->lock);
            spin_while(p, &p->number, last, true);
            pthread_mutex_lock(&p->lock);
            continue;
        }
        if (!p->now.fn || p->number == last) {
            pthread_cond_wait(&p->work, &p->lock);
            continue;
        }
        job const mine = p->now;
        last = p->number;
        p->busy++;
        pthread_mutex_unlock(&p->lock);
        work_off(p, &mine);
        pthread_mutex_lock(&p->lock);
        fresh = true;
        if (--p->busy == 0)
            pthread_cond_signal(&p->done);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

/* The job is closed with the lock taken and no helper busy, so that no helper can take a task of the next
 * job for it. */
static void run(void *user, gait_task_fn *fn, void *ctx, int32_t count)
{
    gait_pool *const p = user;
    job const mine = {.fn = fn, .ctx = ctx, .count = count};
    pthread_mutex_lock(&p->lock);
    p->now = mine;
    p->number++;
    atomic_store(&p->next, 0);
    pthread_cond_broadcast(&p->work);
    pthread_mutex_unlock(&p->lock);
    work_off(p, &mine);
    spin_while(p, &p->busy, 0, false);
    pthread_mutex_lock(&p->lock);
    while (p->busy)
        pthread_cond_wait(&p->done, &p->lock);
    p->now.fn = NULL;
    pthread_mutex_unlock(&p->lock);
}

static gait_pool *layout(arena *a, int32_t threads)
{
    gait_pool *const p = TAKE(a, gait_pool, 1);
    pthread_t *const thread = TAKE(a, pthread_t, threads);
    if (p)
        *p = (gait_pool){.thread = thread};
    return p;
}

gait_result gait_pool_bytes(int32_t threads, size_t *bytes, gait_error *err)
{
    arena a = {.cap = SIZE_MAX};
    if (threads < 1 || threads > GAIT_POOL_MAX)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "pool of %d threads, give 1 to %d", (int)threads,
                         GAIT_POOL_MAX);
    if (!bytes)
        return base_fail(err, GAIT_ERR_ARG, -1, "bytes is NULL");
    layout(&a, threads);
    *bytes = a.used;
    return GAIT_OK;
}

/* Helpers block all signals, so that the program's own threads receive them. */
static bool start_helpers(gait_pool *p, int32_t count)
{
    sigset_t all, before;
    bool ok = true;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    while (ok && p->helpers < count) {
        ok = pthread_create(&p->thread[p->helpers], NULL, helper, p) == 0;
        p->helpers += ok;
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return ok;
}

gait_result gait_pool_init(void *mem, size_t mem_bytes, int32_t threads, gait_pool **out, gait_error *err)
{
    if (!mem || !out)
        return base_fail(err, GAIT_ERR_ARG, -1, "mem or out is NULL");
    arena a = {.base = NULL};
    gait_result s = gait_pool_bytes(threads, &a.used, err);
    if (s == GAIT_OK)
        s = arena_place(&a, mem, mem_bytes, err);
    if (s != GAIT_OK)
        return s;
    gait_pool *const p = layout(&a, threads);
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->work, NULL);
    pthread_cond_init(&p->done, NULL);
    if (!start_helpers(p, threads - 1)) {
        int32_t const started = p->helpers;
        gait_pool_stop(p);
        return base_fail(err, GAIT_ERR_LIMIT, -1, "the system starts only %d of %d threads: give fewer",
                         (int)started + 1, (int)threads);
    }
    *out = p;
    return GAIT_OK;
}

gait_tasks gait_pool_tasks(gait_pool *p)
{
    gait_tasks const none = {NULL, NULL}, tasks = {run, p};
    return p && p->helpers ? tasks : none;
}

void gait_pool_stop(gait_pool *p)
{
    if (!p)
        return;
    pthread_mutex_lock(&p->lock);
    p->quit = true;
    pthread_cond_broadcast(&p->work);
    pthread_mutex_unlock(&p->lock);
    for (int32_t i = 0; i < p->helpers; i++)
        pthread_join(p->thread[i], NULL);
    p->helpers = 0;
    pthread_cond_destroy(&p->done);
    pthread_cond_destroy(&p->work);
    pthread_mutex_destroy(&p->lock);
}
#endif
