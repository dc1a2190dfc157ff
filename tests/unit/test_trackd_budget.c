/* Which frames a latency budget allows, and how the number of particles adapts to it. */
#include "../../tools/trackd/timing.c"
#include "check.h"

enum { MS = 1000 };

static void test_birth(void)
{
    CHECK(budget_birth(5000 * MS, 5030 * MS) == 5000 * MS);
    CHECK(budget_birth(5000 * MS, 6000 * MS) == 5000 * MS);
    CHECK(budget_birth(5000 * MS, 6001 * MS) == 6001 * MS); /* replayed: another clock */
    CHECK(budget_birth(5000 * MS, 4999 * MS) == 4999 * MS); /* the camera's clock is ahead */
    CHECK(budget_birth(7, INT64_C(1790000000000000)) == INT64_C(1790000000000000));
}

static void test_age(void)
{
    budget none = {0}, b = {.limit_us = 40 * MS};
    CHECK(budget_allows(&none, 0, 99999999) && none.late == 0);
    CHECK(budget_allows(&b, 100, 100 + 40 * MS));
    CHECK(!budget_allows(&b, 100, 101 + 40 * MS) && b.late == 1);
    b.step_us = 15 * MS; /* leaves 25 */
    CHECK(budget_allows(&b, 0, 25 * MS) && !budget_allows(&b, 0, 25 * MS + 1));
    b.step_us = 90 * MS; /* leaves nothing: a quarter is reserved for transport */
    CHECK(budget_allows(&b, 0, 10 * MS) && !budget_allows(&b, 0, 10 * MS + 1));
    CHECK(b.late == 3 && b.dropped == 3);
}

/* Frames are never refused forever: if a step takes longer than the budget, a frame is tried after a few were
 * refused. */
static void test_a_slow_step_does_not_starve(void)
{
    enum { FRAMES = 100, AGE = 12 * MS };
    budget b = {.limit_us = 40 * MS, .step_us = 90 * MS}, old = b;
    int tried = 0, row = 0, longest = 0;
    for (int i = 0; i < FRAMES; i++) { /* all of them a little too old for what is left */
        bool const go = budget_allows(&b, 0, AGE);
        row = go ? 0 : row + 1;
        longest = row > longest ? row : longest;
        tried += go;
    }
    CHECK(longest == RETRY && tried == FRAMES / (RETRY + 1));
    CHECK(b.late == FRAMES - tried && b.dropped == b.late);
    for (int i = 0; i < FRAMES; i++) /* one older than the limit is not tried, */
        CHECK(!budget_allows(&old, 0, 40 * MS + 1));
    CHECK(budget_allows(&old, 0, 40 * MS)); /* the next that is not is */
    CHECK(!budget_allows(&old, 0, AGE) && old.refused == 1);
}

/* The tried step shows how long steps take now: where they are fast again, frames come through. */
static void test_a_fast_step_ends_the_refusals(void)
{
    budget b = {.limit_us = 40 * MS, .step_us = 90 * MS};
    int refused = 0;
    for (int i = 0; i < 200; i++) {
        if (budget_allows(&b, 0, 12 * MS))
            budget_stepped(&b, 0, 17 * MS, 5 * MS, 500);
        else
            refused++;
    }
    CHECK(b.step_us < 28 * MS && refused > RETRY && refused < 10 * RETRY);
    CHECK(budget_allows(&b, 0, 12 * MS) && b.over == 0);
}

static void test_late_estimates_are_counted(void)
{
    budget b = {.limit_us = 40 * MS};
    CHECK(budget_stepped(&b, 0, 40 * MS, 20 * MS, 500) == 500 && b.over == 0);
    CHECK(budget_stepped(&b, 0, 41 * MS, 20 * MS, 500) == 500 && b.over == 1);
}

/* Steps whose time is in proportion to the particles; returns their number in the end. */
static int32_t settle(budget *b, int32_t particles, double us_per_particle, int steps)
{
    for (int i = 0; i < steps; i++)
        particles = budget_stepped(b, 0, 0, (int64_t)(us_per_particle * particles), particles);
    return particles;
}

static void test_the_number_follows_the_time(void)
{
    budget b = {.limit_us = 30 * MS, .low = 100, .high = 4000};
    CHECK(settle(&b, 4000, 20, 1) == 4000);    /* one slow step is no reason */
    CHECK(settle(&b, 4000, 20, 1) == 750);     /* two are: as many as take half of the limit */
    CHECK(settle(&b, 750, 20, 1000) == 750);   /* 15 of 30 ms: neither too slow nor idle */
    CHECK(settle(&b, 750, 33, 100) == 375);    /* 25 of 30 ms: half as many */
    CHECK(settle(&b, 1000, 20, 1000) == 1000); /* 20 of 30 ms */
    CHECK(settle(&b, 1000, 1000, 1000) == 100);
    CHECK(settle(&b, 100, 5, 80) == 100);
    CHECK(settle(&b, 100, 5, 100 * 9) == 1600); /* 8 ms: over a quarter */
    CHECK(settle(&b, 1600, 1, 2000) == 4000);
}

/* Ten times over the budget: the second step finds the right number, and no frame is refused for earlier steps. */
static void test_far_over_the_budget_takes_two_steps(void)
{
    budget b = {.limit_us = 50 * MS, .low = 100, .high = 40000};
    CHECK(settle(&b, 40000, 12.5, 2) == 2000);
    CHECK(budget_allows(&b, 0, 10 * MS));
    budget hiccup = {.limit_us = 50 * MS, .low = 100, .high = 1000};
    for (int i = 0; i < 20; i++) { /* single slow steps, each as long as ten */
        CHECK(budget_stepped(&hiccup, 0, 0, i % 10 == 5 ? 60 * MS : 20 * MS, 1000) == 1000);
    }
    budget two = {.limit_us = 50 * MS, .low = 100, .high = 1000}; /* the faster one decides */
    CHECK(budget_stepped(&two, 0, 0, 900 * MS, 1000) == 1000);
    CHECK(budget_stepped(&two, 0, 0, 100 * MS, 1000) == 250);
}

static void test_dropped_frames_halve_it(void)
{
    budget b = {.limit_us = 100 * MS, .low = 100, .high = 4000};
    for (int i = 0; i < 3; i++)
        budget_missed(&b);
    CHECK(settle(&b, 4000, 10, 7) == 4000);
    CHECK(settle(&b, 4000, 10, 1) == 2000);
    CHECK(settle(&b, 2000, 10, 60) == 2000);
    for (int i = 0; i < 60; i++) { /* one now and then does not */
        if (i % 20 == 0)
            budget_missed(&b);
        CHECK(settle(&b, 2000, 20, 1) == 2000);
    }
}

/* Changes of the number in `steps` steps where frames are dropped, one in ten, as long as there are more than `most`. */
static int changes(budget *b, int32_t *particles, int32_t most, int steps)
{
    int count = 0;
    for (int i = 0; i < steps; i++) {
        if (*particles > most && i % 10 == 0)
            budget_missed(b);
        int32_t const wanted = budget_stepped(b, 0, 0, 9 * MS, *particles);
        if (wanted < *particles)
            CHECK(b->reason == BUDGET_DROPPED && b->lost == TOO_MANY);
        if (wanted > *particles)
            CHECK(b->reason == BUDGET_SPARE && b->took_us > 8 * MS && b->took_us <= 9 * MS);
        count += wanted != *particles;
        *particles = wanted;
    }
    return count;
}

/* The number used to double every three seconds forever, and to be halved a second later. */
static void test_what_was_too_many_is_tried_less_and_less_often(void)
{
    enum { SECOND = 30 };
    budget b = {.limit_us = 50 * MS, .low = 500, .high = 4000};
    int32_t particles = 1022;
    CHECK(changes(&b, &particles, 1022, 600 * SECOND) < 24);
    int const tries = changes(&b, &particles, 1022, 600 * SECOND);
    CHECK(tries > 4 && tries < 16); /* it keeps trying */
    CHECK(b.failed == 2044 && b.patience == LONGEST_WAIT);
    changes(&b, &particles, 4000, 600 * SECOND); /* whatever took the time is gone */
    CHECK(particles == 4000 && b.failed == 0 && b.patience == 0);
    CHECK(changes(&b, &particles, 1022, 3 * SECOND) == 2 && particles == 1000);
    particles = 511;
    CHECK(changes(&b, &particles, 1022, 4 * SECOND) == 1 &&
          particles == 1022); /* the daemon does not wait for less than that */
}

static void test_a_step_that_is_too_long_is_the_reason(void)
{
    budget b = {.limit_us = 50 * MS, .low = 100, .high = 4000};
    CHECK(settle(&b, 1000, 60, 2) == 416 && b.reason == BUDGET_SLOW && b.took_us == 60 * MS);
    budget half = {.limit_us = 50 * MS, .low = 100, .high = 4000};
    CHECK(settle(&half, 1000, 40, SETTLE) == 500 && half.reason == BUDGET_SLOW && half.took_us == 40 * MS);
}

static void test_reset_keeps_the_limits(void)
{
    budget b = {.limit_us = 10 * MS, .low = 100, .high = 4000};
    int32_t const particles = settle(&b, 400, 20000, 40);
    CHECK(budget_hopeless(&b, particles) && !budget_allows(&b, 0, 9 * MS));
    budget_reset(&b);
    CHECK(b.limit_us == 10 * MS && b.low == 100 && b.high == 4000);
    CHECK(b.step_us == 0 && b.late == 0 && b.over == 0 && b.slow_steps == 0 && !b.hopeless);
    CHECK(budget_allows(&b, 0, 9 * MS));
}

static void test_without_adapting_it_stays(void)
{
    budget b = {.limit_us = 10 * MS, .high = 4000};
    CHECK(settle(&b, 4000, 100, 500) == 4000);
    CHECK(settle(&b, 500, 0.1, 500) == 500);
}

static void test_steps_longer_than_the_limit_are_reported_once(void)
{
    budget b = {.limit_us = 10 * MS, .high = 4000},
           adapting = {.limit_us = 10 * MS, .low = 100, .high = 4000};
    int reported = 0;
    settle(&b, 500, 20.1, 7);
    CHECK(!budget_hopeless(&b, 500));
    for (int i = 0; i < 30; i++) {
        settle(&b, 500, 20.1, 1);
        reported += budget_hopeless(&b, 500);
    }
    CHECK(reported == 1 && b.slow_steps == 37);
    settle(&b, 500, 19.9, 10);
    CHECK(b.slow_steps == 37 && b.slow == 0);
    int32_t const particles = settle(&adapting, 400, 20000, 2);
    CHECK(particles == 100 && !budget_hopeless(&adapting, particles));
    CHECK(settle(&adapting, particles, 20000, 20) == 100 && budget_hopeless(&adapting, 100));
}

int main(void)
{
    test_birth();
    test_age();
    test_a_slow_step_does_not_starve();
    test_a_fast_step_ends_the_refusals();
    test_late_estimates_are_counted();
    test_the_number_follows_the_time();
    test_far_over_the_budget_takes_two_steps();
    test_dropped_frames_halve_it();
    test_what_was_too_many_is_tried_less_and_less_often();
    test_a_step_that_is_too_long_is_the_reason();
    test_reset_keeps_the_limits();
    test_without_adapting_it_stays();
    test_steps_longer_than_the_limit_are_reported_once();
    return CHECK_DONE();
}
