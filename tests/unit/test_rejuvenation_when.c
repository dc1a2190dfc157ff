/* When a tracker rejuvenates its particles: after resampling, within a hypothesis, never in paper mode. */
#include "tracker/hypotheses.h"

#include "toy_film.h"

#include "check.h"

static gait_tracker *begin(float phase_sd, float rejuvenation_time)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.rejuvenation_time = rejuvenation_time;
    return film_uncertain(&cfg, phase_sd);
}

static bool alike(const gait_tracker *a, const gait_tracker *b)
{
    size_t const values = (size_t)a->particles.fields * (size_t)a->particles.n;
    return a->particles.n == b->particles.n &&
           memcmp(a->particles.value, b->particles.value, values * sizeof *a->particles.value) == 0;
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
        CHECK(soon->core->rejuvenation_utime == (resampled ? soon->core->utime : soon->core->start_utime));
    }
    CHECK(resampled);
    toy_tracker_free(never);
    toy_tracker_free(soon);
}

/* Not during acquisition, because there is no person between two hypotheses. Left and right hypotheses are rejuvenated separately. */
static void test_within_modes(void)
{
    gait_tracker *const never = begin(0.5f, 0.0f), *const soon = begin(0.5f, 0.5f);
    int searched = 0;
    bool rejuvenated = false;
    for (int n = 0; n < 40; n++) {
        gait_estimate e, f;
        film_step(never, 1, n, 0, &e);
        film_step(soon, 1, n, 0, &f);
        bool const searching = soon->core->hypotheses.stage == HYPOTHESES_ACQUISITION;
        searched += searching && (f.flags & GAIT_EST_RESAMPLED);
        rejuvenated = rejuvenated || !alike(never, soon);
        CHECK(soon->core->hypotheses.stage != HYPOTHESES_ONE && !(searching && rejuvenated));
        never->core->hypotheses.log_odds = soon->core->hypotheses.log_odds = 0.0; /* open */
    }
    CHECK(searched > 0 && rejuvenated);
    toy_tracker_free(never);
    toy_tracker_free(soon);
}

static void test_never_in_paper_mode(void)
{
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, GAIT_MODE_PAPER);
    CHECK(cfg.rejuvenation_time == 0.0f);
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    CHECK(cfg.rejuvenation_time > 0.0f);
}

int main(void)
{
    film_make(1, 46);
    test_after_resampling();
    test_within_modes();
    test_never_in_paper_mode();
    return CHECK_DONE();
}
