#include "base/task.h"

#include "check.h"

#include <pthread.h>
#include <stdlib.h>

enum { MOST = 300 };

typedef struct record {
    int32_t block, tasks;
    int32_t hits[4096];
    int32_t faults[MOST]; /* of each task: ranges that are empty, or begin within a block */
    int32_t first[MOST];  /* of each task: where it began, if it was -1 */
} record;

static void note(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    record *const r = ctx;
    if (task < 0 || task >= r->tasks)
        abort();
    r->faults[task] += begin >= end || begin % r->block != 0;
    if (r->first[task] == -1)
        r->first[task] = begin;
    for (int32_t i = begin; i < end; i++)
        r->hits[i]++;
}

/* An executor that runs the tasks in reverse order. */
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

/* An executor with one thread per task. */
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

/* Every item once, in ranges of whole blocks. */
static void check_cover(const record *r, int32_t items)
{
    bool ok = true;
    for (int32_t i = 0; i < 4096; i++)
        ok &= r->hits[i] == (i < items);
    for (int32_t t = 0; t < r->tasks; t++)
        ok &= r->faults[t] == 0;
    CHECK(ok);
}

/* A task begins with its own part and, where no other task has, continues with those of the others. */
static void test_own_part(void)
{
    enum { TASKS = 4, ITEMS = 1000 };
    static record r;
    int runs = 0;
    gait_tasks const reverse = {backwards, &runs};
    r = (record){.block = 1, .tasks = TASKS, .first = {-1, -1, -1, -1}};
    task_run(&reverse, TASKS, ITEMS, 1, note, &r);
    check_cover(&r, ITEMS);
    CHECK(r.first[TASKS - 1] == (TASKS - 1) * ITEMS / TASKS);
    CHECK(r.first[0] == -1 && r.first[1] == -1 && r.first[2] == -1);
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
                plain = other = (record){.block = block[b], .tasks = tasks[t]};
                task_run(&inline_exec, tasks[t], items[i], block[b], note, &plain);
                check_cover(&plain, items[i]);
                task_run(&reverse, tasks[t], items[i], block[b], note, &other);
                check_cover(&other, items[i]);
            }
    CHECK(runs == 6 * 7 * 3);
    static record big;
    for (int round = 0; round < 20; round++) {
        big = (record){.block = 16, .tasks = 7};
        task_run(&parallel, 7, 4000, 16, note, &big);
        check_cover(&big, 4000);
    }
    test_own_part();
    return CHECK_DONE();
}
