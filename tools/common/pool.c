#include "pool.h"

#include <string.h>

/* Do tasks until none is left to hand out; called and left with the lock held. */
static void work_off(pool *p)
{
    while (p->next < p->count) {
        int32_t const task = p->next++;
        gait_task_fn *const fn = p->fn;
        void *const ctx = p->ctx;
        pthread_mutex_unlock(&p->lock);
        fn(ctx, task);
        pthread_mutex_lock(&p->lock);
        if (--p->left == 0)
            pthread_cond_signal(&p->done);
    }
}

static void *helper(void *arg)
{
    pool *const p = arg;
    pthread_mutex_lock(&p->lock);
    while (!p->quit) {
        work_off(p);
        if (!p->quit)
            pthread_cond_wait(&p->work, &p->lock);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

static void run(void *user, gait_task_fn *fn, void *ctx, int32_t count)
{
    pool *const p = user;
    pthread_mutex_lock(&p->lock);
    p->fn = fn;
    p->ctx = ctx;
    p->next = 0;
    p->count = p->left = count;
    pthread_cond_broadcast(&p->work);
    work_off(p);
    while (p->left)
        pthread_cond_wait(&p->done, &p->lock);
    pthread_mutex_unlock(&p->lock);
}

bool pool_start(pool *p, int threads, message *why)
{
    *p = (pool){0};
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->work, NULL);
    pthread_cond_init(&p->done, NULL);
    for (; p->threads < threads - 1; p->threads++) {
        int const failed = pthread_create(&p->thread[p->threads], NULL, helper, p);
        if (failed) {
            message_set(why, "--threads %d: cannot start a thread: %s", threads, strerror(failed));
            pool_stop(p);
            return false;
        }
    }
    return true;
}

void pool_stop(pool *p)
{
    pthread_mutex_lock(&p->lock);
    p->quit = true;
    pthread_cond_broadcast(&p->work);
    pthread_mutex_unlock(&p->lock);
    for (int i = 0; i < p->threads; i++)
        pthread_join(p->thread[i], NULL);
    pthread_cond_destroy(&p->done);
    pthread_cond_destroy(&p->work);
    pthread_mutex_destroy(&p->lock);
    p->threads = 0;
}

gait_tasks pool_tasks(pool *p)
{
    gait_tasks const none = {0}, tasks = {.run = run, .user = p};
    return p->threads ? tasks : none;
}
