/* When a tracker's particles mingle: after they were drawn by weight, within a mode, never in paper mode. */
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

/* Not while a phase is searched: between two modes there is nobody.  Left and right, once apart, mingle by themselves. */
static void test_within_modes(void)
{
    gait_tracker *const never = begin(0.5f, 0.0f), *const soon = begin(0.5f, 0.5f);
    int searched = 0;
    bool mingled = false;
    for (int n = 0; n < 40; n++) {
        gait_estimate e, f;
        film_step(never, 1, n, 0, &e);
        film_step(soon, 1, n, 0, &f);
        bool const searching = soon->core->modes.stage == MODES_SEARCH;
        searched += searching && (f.flags & GAIT_EST_RESAMPLED);
        mingled = mingled || !alike(never, soon);
        CHECK(soon->core->modes.stage != MODES_SINGLE && !(searching && mingled));
        never->core->modes.odds = soon->core->modes.odds = 0.0; /* open */
    }
    CHECK(searched > 0 && mingled);
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
    test_within_modes();
    test_never_in_paper_mode();
    return CHECK_DONE();
}
