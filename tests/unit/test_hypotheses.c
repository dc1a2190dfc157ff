/* Left and right: two hypotheses that sampling noise cannot eliminate, and how one is dropped. */
#include "tracker/hypotheses.h"

#include "toy_film.h"

#include "check.h"

enum { N = 400, HALF = N / 2 };

static gait_tracker *begin(float phase_sd)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = N;
    return film_uncertain(&cfg, phase_sd);
}

static double weight_of(const gait_tracker *t, int32_t from, int32_t to)
{
    double sum = 0.0;
    for (int32_t i = from; i < to; i++)
        sum += t->filter.weight[i];
    return sum;
}

/* Mean phase of a hypothesis, as a vector in double precision. */
static double phase_of(const gait_tracker *t, int32_t from)
{
    const float *const phase = field(&t->particles, F_PHASE);
    double c = 0.0, s = 0.0;
    for (int32_t i = from; i < from + HALF; i++) {
        c += t->filter.weight[i] * cos(2 * TOY_PI * (double)phase[i]);
        s += t->filter.weight[i] * sin(2 * TOY_PI * (double)phase[i]);
    }
    return atan2(s, c) / (2 * TOY_PI);
}

static void test_a_known_phase_is_never_split(void)
{
    gait_tracker *const t = begin(0.05f);
    for (int n = 0; n < 40; n++) {
        gait_estimate e;
        film_step(t, 1, n, 0, &e);
        CHECK(t->core->hypotheses.stage == HYPOTHESES_ONE && e.status == GAIT_TRACK_TRACKING);
        CHECK_NEAR(hypotheses_settled_time(t), n / 30.0, 1e-3);
    }
    toy_tracker_free(t);
}

/* Half a stride apart; no particle changes its hypothesis; the weight of a hypothesis follows from the odds alone. */
static void test_both_hypotheses_survive(void)
{
    gait_tracker *const t = begin(0.5f);
    gait_estimate e;
    for (int n = 0; n < 16; n++) {
        CHECK(t->core->hypotheses.stage == HYPOTHESES_ACQUISITION);
        film_step(t, 1, n, 0, &e);
        CHECK(e.status == GAIT_TRACK_INIT);
    }
    CHECK(t->core->hypotheses.stage == HYPOTHESES_TWO);
    for (int n = 16; n < 40; n++) {
        double const apart = phase_of(t, HALF) - phase_of(t, 0);
        CHECK_NEAR(fabs(apart - floor(apart) - 0.5), 0.0, 0.1);
        film_step(t, 1, n, 0, &e);
        for (int32_t i = 0; i < N; i++)
            CHECK((t->filter.parent[i] >= HALF) == (i >= HALF) && hypothesis_of(t, i) == (i >= HALF));
        double const share = 1.0 / (1.0 + exp(-t->core->hypotheses.log_odds));
        CHECK_NEAR(weight_of(t, HALF, N), share, 1e-9);
        CHECK_NEAR(weight_of(t, 0, HALF), 1.0 - share, 1e-9);
        t->core->hypotheses.log_odds = n % 2 ? 3.0 : -3.5; /* far, but not decided; the weights must follow */
    }
    toy_tracker_free(t);
}

/* Once one hypothesis is certain, its particles replace those of the other. */
static void test_the_loser_is_dropped(void)
{
    for (int32_t winner = 0; winner < 2; winner++) {
        gait_tracker *const t = begin(0.5f);
        gait_estimate e;
        for (int n = 0; n < 20; n++)
            film_step(t, 1, n, 0, &e);
        t->core->hypotheses.log_odds = winner ? 30.0 : -30.0;
        double const phase = phase_of(t, winner * HALF);
        film_step(t, 1, 20, 0, &e);
        CHECK(t->core->hypotheses.stage == HYPOTHESES_ONE && e.flags & GAIT_EST_RESAMPLED);
        for (int32_t i = 0; i < N; i++)
            CHECK((t->filter.parent[i] >= HALF) == (winner == 1));
        CHECK_NEAR(weight_of(t, 0, N), 1.0, 1e-9);
        double const moved = (double)e.mean.phase - phase;
        CHECK_NEAR(moved - floor(moved + 0.5), 0.0, 0.08);
        toy_tracker_free(t);
    }
}

static double stature_sd(const gait_tracker *t)
{
    const float *const x = field(&t->particles, F_STATURE);
    double sum = 0.0, square = 0.0;
    for (int32_t i = 0; i < N; i++) {
        sum += (double)x[i] / N;
        square += (double)x[i] * (double)x[i] / N;
    }
    return sqrt(square - sum * sum);
}

/* Stature varies while left and right are unknown, and settles when they are known. */
static void test_stature_settles_when_all_is_known(void)
{
    double sd[2];
    for (int known = 0; known < 2; known++) {
        gait_tracker *const t = begin(0.5f);
        gait_estimate e;
        t->cfg.stature_noise = 0.0f;
        t->cfg.stature_noise_start = 3.0f;
        t->cfg.settle_time = 0.1f;
        for (int n = 0; n < 45; n++) {
            if (t->core->hypotheses.stage == HYPOTHESES_TWO)
                t->core->hypotheses.log_odds = known ? 30.0 : 0.0;
            film_step(t, 1, n, 0, &e);
        }
        sd[known] = stature_sd(t);
        toy_tracker_free(t);
    }
    CHECK(sd[0] > 1.5 * sd[1]);
}

static void copy_into(gait_tracker *to, const gait_tracker *from)
{
    size_t bytes = 0;
    gait_error err;
    CHECK(gait_tracker_save(from, NULL, 0, &bytes, NULL) == GAIT_OK);
    void *const snapshot = malloc(bytes);
    CHECK(snapshot && gait_tracker_save(from, snapshot, bytes, &bytes, NULL) == GAIT_OK);
    CHECK(gait_tracker_restore(to, snapshot, bytes, &err) == GAIT_OK);
    free(snapshot);
}

/* Acquisition uses more particles, until left and right are known; a snapshot taken meanwhile continues identically. */
static void test_a_search_takes_more(void)
{
    gait_tracker_config cfg = toy_config(1);
    gait_error err;
    cfg.particles = N;
    cfg.acquisition_particles = 3 * N;
    gait_tracker *const t = film_uncertain(&cfg, 0.5f), *const other = film_uncertain(&cfg, 0.5f);
    for (int n = 0; n < 45; n++) {
        gait_estimate e[2];
        bool const open = t->core->hypotheses.stage != HYPOTHESES_ONE;
        CHECK(!open || gait_tracker_particles(t, NULL, NULL, 0, NULL) == 2 * N);
        if (t->core->hypotheses.stage == HYPOTHESES_TWO && n > 30)
            t->core->hypotheses.log_odds = 30.0;
        if (n == 20)
            copy_into(other, t);
        film_step(t, 1, n, 0, &e[0]);
        if (n < 20 || n > 30)
            continue;
        film_step(other, 1, n, 0, &e[1]);
        CHECK(gait_tracker_digest(t) == gait_tracker_digest(other));
    }
    CHECK(t->core->hypotheses.stage == HYPOTHESES_ONE && gait_tracker_particles(t, NULL, NULL, 0, NULL) == N);
    CHECK(gait_tracker_set_particles(t, N + 1, &err) == GAIT_ERR_LIMIT);
    toy_tracker_free(t);
    toy_tracker_free(other);
}

/* Status: ambiguous while the odds are undecided, never tracking. */
static void test_open_odds_are_ambiguous(void)
{
    gait_tracker *const t = begin(0.5f);
    gait_estimate e;
    for (int n = 0; n < 45; n++) {
        t->core->hypotheses.log_odds = 0.0;
        film_step(t, 1, n, 0, &e);
        CHECK(e.status != GAIT_TRACK_TRACKING && (e.status == GAIT_TRACK_INIT || n > 24));
        CHECK(hypotheses_settled_time(t) == 0.0f);
    }
    toy_tracker_free(t);
}

/* The share of a frame's log-likelihood depends on the time since images last supported the estimate, also during
 * acquisition; at the start it is 1. */
static void test_evidence_counts_by_time(void)
{
    static const struct {
        int64_t since; /* microseconds */
        float phase_sd;
        double share;
    } CASES[] = {{0, 0.05f, 1.0},      {20000, 0.05f, 0.2},  {50000, 0.05f, 0.5},
                 {100000, 0.05f, 1.0}, {400000, 0.05f, 1.0}, {20000, 0.5f, 0.2}};
    for (size_t k = 0; k < sizeof CASES / sizeof *CASES; k++) {
        gait_tracker *const t = begin(CASES[k].phase_sd);
        const double *const log_weight = t->filter.log_weight;
        t->cfg.evidence_time = 0.1f;
        t->core->utime = t->core->support_utime + CASES[k].since;
        for (int i = 0; i < N; i++)
            t->loglik[i] = 0.5f * (float)i / (float)N;
        hypotheses_update(t, 1e-6f * (float)CASES[k].since);
        CHECK_NEAR(log_weight[HALF] - log_weight[0], 0.25 * CASES[k].share, 1e-6);
        toy_tracker_free(t);
    }
}

int main(void)
{
    film_make(1, 46);
    test_evidence_counts_by_time();
    test_a_known_phase_is_never_split();
    test_both_hypotheses_survive();
    test_the_loser_is_dropped();
    test_open_odds_are_ambiguous();
    test_stature_settles_when_all_is_known();
    test_a_search_takes_more();
    return CHECK_DONE();
}
