#include "timing.h"

#include <math.h>

/* ---- histogram ---- */
/* Values below 64 have bins of their own; above, each octave has 64. */
static int bin_of(uint32_t v)
{
    int octave = 0;
    for (; v >= 128; v >>= 1)
        octave++;
    return octave * 64 + (int)v;
}

/* Middle of the values that share a bin. */
static uint32_t value_of(int bin)
{
    int const octave = bin < 128 ? 0 : bin / 64 - 1;
    return (((uint32_t)(bin - octave * 64) << octave) * 2 + (1u << octave) - 1) / 2;
}

void histogram_add(histogram *h, int64_t us)
{
    int32_t const v = us < 0 ? 0 : us > INT32_MAX ? INT32_MAX : (int32_t)us;
    int const bin = bin_of((uint32_t)v);
    h->bin[bin]++;
    h->count++;
    h->largest = v > h->largest ? v : h->largest;
}

int32_t histogram_quantile(const histogram *h, double share)
{
    int64_t const rank = (int64_t)ceil(share * (double)h->count);
    int64_t below = 0;
    for (int bin = 0; bin < HISTOGRAM_BINS; bin++) {
        below += h->bin[bin];
        if (h->bin[bin] && below >= rank) {
            uint32_t const v = value_of(bin);
            return v > (uint32_t)h->largest ? h->largest : (int32_t)v;
        }
    }
    return 0;
}

/* ---- budget ---- */
enum {
    SAME_CLOCK_US = 1000000, /* a frame older than this on arrival is from another clock */
    CHECK_EVERY = 30,        /* steps between two checks of the dropped frames */
    SETTLE = 8,              /* steps until step_us reflects a changed number of particles */
    SLOW_STEPS = 2,          /* steps in a row longer than the limit before the number is reduced */
    TOO_MANY = 3,            /* frames dropped between two checks for which the number is halved */
    CALM = 90,               /* fast steps in a row before the number doubles */
    RETRY = 4,               /* frames in a row refused because steps are slow, before one is tried */
    TRIAL = 900,             /* steps after a doubling during which a reduction means that it failed */
    LONGEST_WAIT = 32,       /* longest wait before a failed number is tried again, in multiples of CALM */
};

void budget_reset(budget *b)
{
    *b = (budget){.limit_us = b->limit_us, .low = b->low, .high = b->high};
}

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

/* Number of particles that takes half of the limit, if the time of a step is proportional to it. */
static int32_t fitting(const budget *b, int64_t step_us, int32_t particles)
{
    int64_t const fit = particles * (b->limit_us / 2) / step_us;
    return fit > b->low ? (int32_t)fit : b->low;
}

static int32_t choose(budget *b, int64_t step_us, int32_t particles)
{
    b->reason = BUDGET_SLOW;
    b->took_us = b->step_us;
    if (b->slow >= SLOW_STEPS && particles > b->low) {
        b->took_us = step_us < b->before_us ? step_us : b->before_us;
        return fitting(b, b->took_us, particles);
    }
    int32_t const half = particles / 2 > b->low ? particles / 2 : b->low;
    int32_t const twice = particles * 2 < b->high ? particles * 2 : b->high;
    bool const slow = b->step_us > b->limit_us * 3 / 4;
    if ((slow || b->dropped >= TOO_MANY) && b->steps >= SETTLE && half < particles) {
        b->reason = slow ? BUDGET_SLOW : BUDGET_DROPPED;
        return half;
    }
    b->reason = BUDGET_SPARE;
    bool const soon = b->wait > 0 && twice >= b->failed;
    return b->calm >= CALM && twice > particles && !soon ? twice : particles;
}

/* Learn from a change how long to wait before a failed number is tried again. */
static void learn_patience(budget *b, int32_t wanted, int32_t particles)
{
    b->wait -= b->wait > 0;
    if (wanted > particles) {
        b->trial = TRIAL;
    } else if (wanted < particles && b->trial > 0) {
        b->patience = b->patience ? 2 * b->patience : 2;
        b->patience = b->patience < LONGEST_WAIT ? b->patience : LONGEST_WAIT;
        b->wait = CALM * b->patience;
        b->failed = particles;
        b->trial = 0;
    } else if (b->trial > 0 && --b->trial == 0 && particles >= b->failed) {
        b->patience = b->failed = b->wait = 0;
    }
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
    learn_patience(b, wanted, particles);
    b->before_us = step_us;
    b->lost = b->dropped;
    if (wanted != particles || b->steps >= CHECK_EVERY)
        b->steps = b->dropped = 0;
    if (wanted != particles)
        b->calm = 0;
    if (wanted < particles) { /* frames should not be refused because of earlier steps */
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
