/* The thread pool calls every task once, whatever the number of threads, and returns only then. */
#include "../../tools/common/message.c"
#include "../../tools/common/pool.c"
#include "check.h"

enum { TASKS = 257, ROUNDS = 200 };

static int calls[TASKS];

static void count(void *ctx, int32_t task)
{
    int *const round = ctx;
    calls[task] += *round; /* each task is one thread's own: no lock, and a second call would show */
}

static void test_every_task_once(int threads)
{
    pool p;
    message why;
    int expected = 0;
    gait_tasks tasks;
    memset(calls, 0, sizeof calls);
    CHECK(pool_start(&p, threads, &why));
    tasks = pool_tasks(&p);
    CHECK((tasks.run == NULL) == (threads == 1));
    for (int round = 1; tasks.run && round <= ROUNDS; round++) {
        int const n = round % 3 == 0 ? 1 : TASKS;
        tasks.run(tasks.user, count, &round, n);
        expected += round;
        CHECK(calls[0] == expected);
        for (int i = 1; i < TASKS; i++)
            calls[i] -= n == 1 ? 0 : round;
    }
    for (int i = 1; i < TASKS; i++)
        CHECK(calls[i] == 0);
    pool_stop(&p);
}

int main(void)
{
    for (int threads = 1; threads <= 8; threads++)
        test_every_task_once(threads);
    return CHECK_DONE();
}
