#include "budget.h"

enum {
    SAME_CLOCK_US = 1000000, /* a frame does not take longer to arrive */
    LOOK = 30,               /* steps between two looks at the frames dropped */
    SETTLE = 8,              /* steps until step_us shows what another number of particles takes */
    TOO_MANY = 3,            /* frames dropped between two looks */
    CALM = 90,               /* steps that are fast before the number doubles */
    RETRY = 4,               /* frames refused for the last step's time alone before one is tried again */
};

int64_t budget_birth(int64_t capture_utime, int64_t arrival_utime)
{
    int64_t const way = arrival_utime - capture_utime;
    return way >= 0 && way <= SAME_CLOCK_US ? capture_utime : arrival_utime;
}

bool budget_allows(budget *b, int64_t birth, int64_t now)
{
    int64_t const left = b->limit_us - b->step_us, least = b->limit_us / 4, age = now - birth;
    bool const try = age <= b->limit_us && b->refused >= RETRY;
    if (b->limit_us == 0 || age <= (left > least ? left : least) || try) {
        b->refused = 0;
        return true;
    }
    b->refused++;
    b->late++;
    budget_missed(b);
    return false;
}

void budget_missed(budget *b)
{
    b->dropped++;
    b->calm = 0;
}

static int32_t choose(budget *b, int32_t particles)
{
    int32_t const half = particles / 2 > b->low ? particles / 2 : b->low;
    int32_t const twice = particles * 2 < b->high ? particles * 2 : b->high;
    bool const slow = b->step_us > b->limit_us * 3 / 4 || b->dropped >= TOO_MANY;
    if (slow && b->steps >= SETTLE && half < particles)
        return half;
    return b->calm >= CALM && twice > particles ? twice : particles;
}

int32_t budget_stepped(budget *b, int64_t birth, int64_t now, int64_t step_us, int32_t particles)
{
    if (b->limit_us == 0)
        return particles;
    b->over += now - birth > b->limit_us;
    b->step_us += b->step_us ? (step_us - b->step_us) / 4 : step_us;
    b->calm = step_us < b->limit_us / 4 ? b->calm + 1 : 0;
    b->slow = step_us > b->limit_us ? b->slow + 1 : 0;
    b->slow_steps += b->slow > 0;
    b->steps++;
    int32_t const wanted = b->low ? choose(b, particles) : particles;
    if (wanted != particles || b->steps >= LOOK)
        b->steps = b->dropped = 0;
    if (wanted != particles)
        b->calm = 0;
    return wanted;
}

bool budget_hopeless(budget *b, int32_t particles)
{
    if (b->hopeless || b->slow < SETTLE || (b->low && particles > b->low))
        return false;
    return b->hopeless = true;
}
