/* Loss and recovery: nobody there, hidden for a while, back where expected or elsewhere. */
#include "loss.h"

#include "toy_film.h"

#include "check.h"

/* The picture of film frame `shown`, or the empty scene if negative, at time n. */
static void show(gait_tracker *t, int n, int shown, gait_estimate *e)
{
    const uint8_t *const shots[SCENE_CAMERAS] = {shown < 0 ? film_wall[0] : film[0][shown], NULL};
    toy_tracker_step(t, n, shots, e);
}

static gait_tracker *begin(void)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = 600;
    return film_tracker(&cfg, 0, 0.5f);
}

static double off(const gait_estimate *e, int shown)
{
    gait_state const true_state = toy_walk((float)shown / 30.0f);
    return hypot((double)(e->mean.pelvis[0] - true_state.pelvis[0]),
                 (double)(e->mean.pelvis[1] - true_state.pelvis[1]));
}

/* In the empty scene nobody is ever said to be tracked. */
static void test_empty_scene(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    for (int n = 0; n < 60; n++) {
        show(t, n, -1, &e);
        CHECK(e.status == (n < 10 ? GAIT_STATUS_INIT : GAIT_STATUS_LOST));
    }
    toy_tracker_free(t);
}

/* Hidden for most of a second: lost, and tracked at once when seen again, on the same legs. */
static void test_hidden(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    for (int n = 0; n < 20; n++)
        show(t, n, n, &e);
    CHECK(e.status == GAIT_STATUS_TRACKING && !loss_is_lost(t));
    for (int n = 20; n < 45; n++) {
        show(t, n, -1, &e);
        CHECK((e.status == GAIT_STATUS_LOST) == (n >= 29) && loss_is_lost(t) == (n >= 29));
    }
    for (int n = 45; n < 60; n++) {
        show(t, n, n, &e);
        CHECK(e.status == GAIT_STATUS_TRACKING || n < 48);
    }
    double const phase = (double)(e.mean.phase - toy_walk(59.0f / 30.0f).phase);
    CHECK_NEAR(phase - floor(phase + 0.5), 0.0, 0.03);
    CHECK(off(&e, 59) < 0.1);
    toy_tracker_free(t);
}

/* Back further on and in another phase than predicted: found by searching, and then not simply believed where
 * that changes the phase.  Which of the two it is depends on the draws. */
static void test_elsewhere(void)
{
    enum { SEEDS = 8 };
    int found = 0, careful = 0;
    for (int seed = 1; seed <= SEEDS; seed++) {
        gait_tracker *const t = begin();
        gait_estimate e;
        int open = 0;
        t->cfg.seed = (uint64_t)seed;
        for (int n = 0; n < 20; n++)
            show(t, n, n, &e);
        for (int n = 20; n < 40; n++)
            show(t, n, -1, &e);
        for (int n = 40; n < 52; n++) {
            show(t, n, n + 12, &e);
            open += e.status == GAIT_STATUS_INIT;
        }
        found += e.status != GAIT_STATUS_LOST && off(&e, 63) < 0.5;
        careful += open > 5;
        toy_tracker_free(t);
    }
    CHECK(found >= SEEDS - 1);
    CHECK(careful >= 2);
}

/* No particle counts as less likely than somebody hidden. */
static void test_the_bound(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    double lowest = 1e9, highest = -1e9, least = 1e9;
    show(t, 0, 0, &e);
    for (int32_t i = 0; i < 600; i++) {
        lowest = fmin(lowest, (double)t->ll[i]);
        highest = fmax(highest, (double)t->ll[i]);
        least = fmin(least, (double)t->used[i]);
        CHECK(t->used[i] >= t->ll[i]);
    }
    CHECK(lowest < highest - 10.0 && least > lowest && least < highest);
    toy_tracker_free(t);
}

int main(void)
{
    film_make(1, 64);
    test_empty_scene();
    test_hidden();
    test_elsewhere();
    test_the_bound();
    return CHECK_DONE();
}
