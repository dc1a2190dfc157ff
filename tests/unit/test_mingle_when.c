/* When a tracker's particles mingle: after they were drawn by weight, while there is one mode, never in paper mode. */
#include "modes.h"

#include "toy_film.h"

#include "check.h"

static gait_tracker *begin(float phase_sd, float mingle_time)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.mingle_time = mingle_time;
    return film_doubtful(&cfg, phase_sd);
}

static bool alike(const gait_tracker *a, const gait_tracker *b)
{
    size_t const values = (size_t)a->people.fields * (size_t)a->people.n;
    return a->people.n == b->people.n &&
           memcmp(a->people.value, b->people.value, values * sizeof *a->people.value) == 0;
}

static void test_after_resampling(void)
{
    gait_tracker *const never = begin(0.05f, 0.0f), *const soon = begin(0.05f, 0.5f);
    bool resampled = false;
    for (int n = 0; n < 20 && !resampled; n++) {
        gait_estimate e, f;
        film_step(never, 1, n, 0, &e);
        film_step(soon, 1, n, 0, &f);
        resampled = (f.flags & GAIT_EST_RESAMPLED) != 0;
        CHECK(alike(never, soon) == !resampled);
        CHECK(soon->core->mingle_utime == (resampled ? soon->core->utime : soon->core->start_utime));
    }
    CHECK(resampled);
    toy_tracker_free(never);
    toy_tracker_free(soon);
}

/* Half a stride apart there are two modes until one is given up. */
static void test_in_one_mode(void)
{
    gait_tracker *const never = begin(0.5f, 0.0f), *const soon = begin(0.5f, 0.5f);
    int resampled = 0;
    for (int n = 0; n < 40; n++) {
        gait_estimate e, f;
        film_step(never, 1, n, 0, &e);
        film_step(soon, 1, n, 0, &f);
        resampled += (f.flags & GAIT_EST_RESAMPLED) != 0;
        CHECK(soon->core->modes.stage != MODES_SINGLE && alike(never, soon));
        never->core->modes.odds = soon->core->modes.odds = 0.0; /* open */
    }
    CHECK(resampled > 3);
    toy_tracker_free(never);
    toy_tracker_free(soon);
}

static void test_never_in_paper_mode(void)
{
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, GAIT_MODE_PAPER);
    CHECK(cfg.mingle_time == 0.0f);
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    CHECK(cfg.mingle_time > 0.0f);
}

int main(void)
{
    film_make(1, 46);
    test_after_resampling();
    test_in_one_mode();
    test_never_in_paper_mode();
    return CHECK_DONE();
}
