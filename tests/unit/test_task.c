#include "task.h"

#include "check.h"

#include <pthread.h>

enum { MOST = 300 };

typedef struct record {
    int32_t begin[MOST], end[MOST], calls[MOST];
    int32_t hits[4096];
} record;

static void note(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    record *const r = ctx;
    r->begin[task] = begin;
    r->end[task] = end;
    r->calls[task]++;
    for (int32_t i = begin; i < end; i++)
        r->hits[i]++;
}

/* An executor that runs the pieces backwards. */
static void backwards(void *user, gait_task_fn *fn, void *ctx, int32_t count)
{
    ++*(int *)user;
    for (int32_t i = count; i-- > 0;)
        fn(ctx, i);
}

typedef struct job {
    gait_task_fn *fn;
    void *ctx;
    int32_t task;
} job;

static void *run_job(void *arg)
{
    job *const j = arg;
    j->fn(j->ctx, j->task);
    return NULL;
}

/* An executor with a thread for every piece. */
static void threads(void *user, gait_task_fn *fn, void *ctx, int32_t count)
{
    pthread_t id[MOST];
    job jobs[MOST];
    (void)user;
    for (int32_t i = 0; i < count; i++) {
        jobs[i] = (job){fn, ctx, i};
        CHECK(pthread_create(&id[i], NULL, run_job, &jobs[i]) == 0);
    }
    for (int32_t i = 0; i < count; i++)
        pthread_join(id[i], NULL);
}

/* Ranges are contiguous, at multiples of block, balanced to one block and cover every item once. */
static void check_split(const record *r, int32_t tasks, int32_t items, int32_t block)
{
    int32_t at = 0, shortest = items, longest = 0;
    bool ok = true;
    for (int32_t t = 0; t < tasks; t++) {
        ok &= r->calls[t] == 1 && r->begin[t] == at && r->end[t] >= at && (at % block == 0 || at == items);
        at = r->end[t];
        if (at < items) {
            shortest = i_min(shortest, at - r->begin[t]);
            longest = i_max(longest, at - r->begin[t]);
        }
    }
    for (int32_t i = 0; i < items; i++)
        ok &= r->hits[i] == 1;
    CHECK(ok && at == items);
    CHECK(longest - shortest <= block);
}

int main(void)
{
    static const int32_t tasks[] = {1, 2, 3, 16, 64, 256}, items[] = {0, 1, 15, 16, 17, 1000, 4096};
    static const int32_t block[] = {1, 16, 256};
    int runs = 0;
    gait_tasks const inline_exec = {NULL, NULL}, reverse = {backwards, &runs}, parallel = {threads, NULL};
    for (size_t t = 0; t < sizeof tasks / sizeof *tasks; t++)
        for (size_t i = 0; i < sizeof items / sizeof *items; i++)
            for (size_t b = 0; b < sizeof block / sizeof *block; b++) {
                static record plain, other;
                plain = other = (record){0};
                task_run(&inline_exec, tasks[t], items[i], block[b], note, &plain);
                check_split(&plain, tasks[t], items[i], block[b]);
                task_run(&reverse, tasks[t], items[i], block[b], note, &other);
                CHECK(memcmp(&plain, &other, sizeof plain) == 0);
            }
    CHECK(runs == 6 * 7 * 3);
    static record big;
    task_run(&parallel, 7, 4000, 16, note, &big);
    check_split(&big, 7, 4000, 16);
    return CHECK_DONE();
}
