/* Spikes are left out of a window; correct points stay, also those that come back after a gap. */
#include "lift/robust.h"

#include "check.h"

enum { FRAMES = 15, RUNS = 300 };

static double at[FRAMES], uv[2 * FRAMES], sd[FRAMES], scratch[2 * FRAMES];

static double noise(uint32_t *seed)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        *seed = *seed * 1664525u + 1013904223u;
        sum += *seed / 4294967296.0;
    }
    return sum;
}

/* A foot at 30 frames a second: it goes on and swings by 45 pixels, with one pixel of noise. */
static void walk(uint32_t seed)
{
    double const turn = 0.1 * seed;
    for (int f = 0; f < FRAMES; f++) {
        double const t = f / 30.0, angle = 5.65 * (t + turn);
        at[f] = f;
        sd[f] = 1.0;
        uv[2 * f] = 100.0 * t + 45.0 * sin(angle) + noise(&seed);
        uv[2 * f + 1] = 300.0 + 12.0 * sin(2.0 * angle) + noise(&seed);
    }
}

/* Clear the window; returns how many points are left out. */
static int cleared(void)
{
    int before = 0, after = 0;
    for (int f = 0; f < FRAMES; f++)
        before += sd[f] > 0.0;
    int32_t const spikes = lift_remove_spikes(FRAMES, 1, at, uv, sd, scratch);
    for (int f = 0; f < FRAMES; f++)
        after += sd[f] > 0.0;
    CHECK(spikes == before - after);
    return before - after;
}

/* Not observed for `gap` frames before the last one, or before the middle. */
static void test_gaps(int gap, int last)
{
    int lost = 0;
    for (uint32_t run = 0; run < RUNS; run++) {
        walk(run);
        for (int f = last - gap; f < last; f++)
            sd[f] = -1.0;
        lost += cleared();
    }
    CHECK(lost <= RUNS / 100);
}

static void test_spike(int f, double by)
{
    walk(7);
    uv[2 * f] += by;
    CHECK(cleared() == 1 && sd[f] < 0.0);
}

int main(void)
{
    for (int gap = 0; gap <= 9; gap += 3) {
        test_gaps(gap, FRAMES - 1);
        test_gaps(gap, FRAMES - 3);
    }
    for (int f = 0; f < FRAMES; f++)
        test_spike(f, f % 2 ? 150.0 : -150.0);
    return CHECK_DONE();
}
