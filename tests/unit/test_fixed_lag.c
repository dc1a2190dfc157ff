/* Estimates of earlier frames: against ancestors traced by the test, at their limits, after a restore, and more certain. */
#include "tracker/tracker.h"

#include "toy_film.h"

#include "check.h"

enum { SHOTS = 40, PARTICLES = 200 };

typedef struct history { /* what the test records of each step */
    gait_state state[SHOTS][PARTICLES];
    int32_t parent[SHOTS][PARTICLES];
    gait_estimate estimate[SHOTS];
} history;

static history recorded;

static void note(const gait_tracker *t, int n, const gait_estimate *e)
{
    float weight[PARTICLES];
    CHECK(gait_tracker_particles(t, recorded.state[n], weight, PARTICLES, NULL) == PARTICLES);
    memcpy(recorded.parent[n], t->filter.parent, sizeof recorded.parent[n]);
    recorded.estimate[n] = *e;
}

/* Mean and standard deviation of the pelvis's x `back` steps before step n, and how many ancestors there are. */
static int by_hand(const gait_tracker *t, int n, int back, double *mean, double *sd)
{
    bool used[PARTICLES] = {false};
    double sum = 0.0, square = 0.0;
    int count = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < PARTICLES; i++) {
            int a = i;
            for (int k = n; k > n - back; k--)
                a = recorded.parent[k][a];
            double const x = (double)recorded.state[n - back][a].pelvis[0], w = t->filter.weight[i];
            sum += pass ? 0.0 : w * x;
            square += pass ? w * (x - sum) * (x - sum) : 0.0;
            used[a] |= w > 0.0;
        }
    for (int i = 0; i < PARTICLES; i++)
        count += used[i];
    *mean = sum;
    *sd = sqrt(square);
    return count;
}

static gait_tracker_config config(int32_t frames)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.particles = PARTICLES;
    cfg.lag = frames;
    return cfg;
}

/* Frame after frame, every lag: mean, standard deviation, time and the present itself. */
static void test_ancestors(void)
{
    gait_tracker_config const cfg = config(5);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    gait_estimate e, past;
    int fewer = 0;
    for (int n = 0; n < SHOTS; n++) {
        film_step(t, 1, n, n == 20 ? 1u : 0u, &e); /* one frame without an image */
        note(t, n, &e);
        for (int back = 0; back <= 5; back++) {
            gait_result const s = gait_tracker_lagged(t, back, &past, NULL);
            double mean, sd;
            CHECK(s == (back > n ? GAIT_ERR_STATE : GAIT_OK));
            if (s != GAIT_OK)
                continue;
            int const count = by_hand(t, n, back, &mean, &sd);
            CHECK_NEAR(past.pose.joint[0][0], mean, 2e-5);
            CHECK_NEAR(past.joint_sd[0][0], sd, 2e-5);
            CHECK(past.utime == recorded.estimate[n - back].utime && past.frame == (uint64_t)(n - back));
            CHECK(past.flags == recorded.estimate[n - back].flags);
            CHECK(past.ess >= 1.0f && past.ess <= (float)count + 0.01f);
            fewer += back == 5 && count < PARTICLES / 2;
        }
        CHECK(gait_tracker_lagged(t, 0, &past, NULL) == GAIT_OK);
        CHECK(memcmp(&past.mean, &e.mean, sizeof e.mean) == 0 && memcmp(&past.sd, &e.sd, sizeof e.sd) == 0);
        CHECK(memcmp(&past.pose, &e.pose, sizeof e.pose) == 0 && past.ess == e.ess);
        CHECK(past.status == e.status);
    }
    CHECK(fewer > SHOTS / 2); /* the number of ancestors does decrease */
    free(t);
}

/* Lagged estimates change nothing; a restored tracker gives the same ones. */
static void test_kept(void)
{
    gait_tracker_config const cfg = config(3);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f), *const u = film_tracker(&cfg, 7, 0.5f);
    gait_estimate e, a, b;
    size_t bytes = 0;
    for (int n = 0; n < 12; n++)
        film_step(t, 1, n, 0, &e);
    uint64_t const digest = gait_tracker_digest(t);
    CHECK(gait_tracker_lagged(t, 3, &a, NULL) == GAIT_OK && gait_tracker_digest(t) == digest);
    CHECK(gait_tracker_save(t, NULL, 0, &bytes, NULL) == GAIT_OK);
    unsigned char *const kept = malloc(bytes);
    if (!kept)
        abort();
    CHECK(gait_tracker_save(t, kept, bytes, &bytes, NULL) == GAIT_OK);
    CHECK(gait_tracker_restore(u, kept, bytes, NULL) == GAIT_OK);
    CHECK(gait_tracker_lagged(u, 3, &b, NULL) == GAIT_OK && memcmp(&a, &b, sizeof a) == 0);
    toy_tracker_start(u, 0, 0.5f); /* a new start forgets */
    CHECK(gait_tracker_lagged(u, 0, &b, NULL) == GAIT_ERR_STATE);
    free(kept);
    free(t);
    free(u);
}

static void test_limits(void)
{
    gait_tracker_config const some = config(2), none = config(0);
    gait_tracker *const t = film_tracker(&some, 0, 1.0f), *const off = film_tracker(&none, 0, 1.0f);
    gait_estimate e, untouched;
    gait_error err;
    size_t with = 0, without = 0;
    CHECK(gait_tracker_bytes(toy_model(), &some, &with, NULL) == GAIT_OK);
    CHECK(gait_tracker_bytes(toy_model(), &none, &without, NULL) == GAIT_OK && with > without);
    film_step(t, 1, 0, 0, &e);
    film_step(off, 1, 0, 0, &untouched);
    CHECK(memcmp(&e, &untouched, sizeof e) == 0); /* the tracker itself does not care */
    CHECK(gait_tracker_lagged(NULL, 0, &e, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_lagged(t, 0, NULL, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_lagged(t, -1, &e, NULL) == GAIT_ERR_ARG);
    CHECK(gait_tracker_lagged(t, 3, &e, &err) == GAIT_ERR_ARG && strstr(err.text, "lag"));
    CHECK(gait_tracker_lagged(t, 1, &e, NULL) == GAIT_ERR_STATE);
    CHECK(gait_tracker_lagged(off, 0, &e, NULL) == GAIT_ERR_ARG);
    CHECK(memcmp(&e, &untouched, sizeof e) == 0);
    free(t);
    free(off);
}

/* The following frames reduce the mean uncertainty of the pelvis's place along the path. */
static void test_surer(void)
{
    gait_tracker_config const cfg = config(5);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    double now = 0.0, later = 0.0;
    gait_estimate e[SHOTS], past;
    for (int n = 0; n < SHOTS; n++) {
        film_step(t, 1, n, 0, &e[n]);
        if (n < 15)
            continue;
        CHECK(gait_tracker_lagged(t, 5, &past, NULL) == GAIT_OK);
        for (int p = 0; p < toy_model()->points; p++)
            for (int k = 0; k < 3; k++) {
                now += (double)e[n - 5].joint_sd[p][k];
                later += (double)past.joint_sd[p][k];
            }
    }
    CHECK(later < 0.97 * now && later > 0.2 * now);
    free(t);
}

/* A flag of other bodies, on a frame or soon after, makes it ambiguous; one before it, or much later, does not. */
static void test_checks(void)
{
    gait_tracker_config const cfg = config(30);
    gait_tracker *const t = film_tracker(&cfg, 0, 1.0f);
    gait_estimate e, past;
    for (int n = 0; n < SHOTS; n++)
        film_step(t, 1, n, 0, &e);
    CHECK(e.status == GAIT_TRACK_TRACKING && !(e.flags & GAIT_EST_OTHERS_FIT));
    int32_t const slot = history_slot(&t->history, t->core->generation, 5);
    int64_t const age = t->history.record[slot].age;
    int ambiguous = 0, tracked = 0;
    t->history.record[slot].flags |= GAIT_EST_OTHERS_FIT;
    for (int back = 1; back <= 30; back++) {
        CHECK(gait_tracker_lagged(t, back, &past, NULL) == GAIT_OK);
        int64_t const before = age - (past.utime - t->core->start_utime);
        bool const flagged = before >= 0 && before <= 700000;
        CHECK(past.status == (flagged ? GAIT_TRACK_AMBIGUOUS : GAIT_TRACK_TRACKING));
        ambiguous += flagged;
        tracked += !flagged;
    }
    CHECK(ambiguous > 5 && tracked > 5);
    t->history.record[slot].flags &= ~GAIT_EST_OTHERS_FIT;
    CHECK(gait_tracker_lagged(t, 5, &past, NULL) == GAIT_OK && past.status == GAIT_TRACK_TRACKING);
    t->core->found = 0; /* no image has proven a person */
    t->history.record[slot].status = GAIT_TRACK_INIT;
    CHECK(gait_tracker_lagged(t, 5, &past, NULL) == GAIT_OK && past.status == GAIT_TRACK_INIT);
    free(t);
}

int main(void)
{
    film_make(1, SHOTS);
    test_ancestors();
    test_kept();
    test_limits();
    test_surer();
    test_checks();
    return CHECK_DONE();
}
