#include "budget.h"

enum {
    SAME_CLOCK_US = 1000000, /* a frame does not take longer to arrive */
    LOOK = 30,               /* steps between two looks at the frames dropped */
    SETTLE = 8,              /* steps until step_us shows what another number of particles takes */
    FAR = 2,                 /* steps in a row longer than the limit that are no accident */
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

/* As many as take half of the limit, if a step's time is in proportion to them. */
static int32_t fitting(const budget *b, int64_t step_us, int32_t particles)
{
    int64_t const fit = particles * (b->limit_us / 2) / step_us;
    return fit > b->low ? (int32_t)fit : b->low;
}

static int32_t choose(budget *b, int64_t step_us, int32_t particles)
{
    if (b->slow >= FAR && particles > b->low)
        return fitting(b, step_us < b->before_us ? step_us : b->before_us, particles);
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
    int32_t const wanted = b->low ? choose(b, step_us, particles) : particles;
    b->before_us = step_us;
    if (wanted != particles || b->steps >= LOOK)
        b->steps = b->dropped = 0;
    if (wanted != particles)
        b->calm = 0;
    if (wanted < particles) { /* so that frames are not refused for what steps took before */
        b->step_us = b->step_us * wanted / particles;
        b->slow = 0;
    }
    return wanted;
}

bool budget_hopeless(budget *b, int32_t particles)
{
    if (b->hopeless || b->slow < SETTLE || (b->low && particles > b->low))
        return false;
    return b->hopeless = true;
}
