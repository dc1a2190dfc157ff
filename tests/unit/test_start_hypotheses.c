/* A tracker started from several hypotheses: the images choose between them, and against no person.
 *
 * With the argument `digest` it only prints those of a run (golden.h). */
#include "gait_start.h"
#include "golden.h"
#include "toy_film.h"
#include "tracker/tracker.h"

#include "check.h"

enum { FRAMES = 40, FILM = 55 };

static gait_tracker_config config(void)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.acquisition_particles = 2 * cfg.particles;
    return cfg;
}

/* The truth of the first frame. */
static gait_hypothesis truth(float probability)
{
    return (gait_hypothesis){.mean = toy_walk(0.0f), .sd = toy_start_sd(1.0f), .probability = probability};
}

/* Half a stride ahead, or walking the other way. */
static gait_hypothesis half_stride(float probability)
{
    gait_hypothesis h = truth(probability);
    h.mean.phase = m_wrap1(h.mean.phase + 0.5f);
    return h;
}

static gait_hypothesis other_way(float probability)
{
    gait_hypothesis h = truth(probability);
    h.mean.heading = m_wrap_pi(h.mean.heading + PI_F);
    return h;
}

static gait_tracker *begin(const gait_tracker_config *cfg, const gait_hypothesis *h, int32_t count)
{
    gait_tracker *const t = film_tracker(cfg, 0, 1.0f);
    CHECK(gait_tracker_start_hypotheses(t, h, count, toy_frame(0).utime, NULL) == GAIT_OK);
    return t;
}

/* Particles within a quarter of a stride and 90 degrees of a hypothesis. */
static int particles_of(const gait_tracker *t, const gait_hypothesis *h)
{
    int n = 0;
    for (int32_t i = 0; i < t->cfg.particles; i++) {
        particle_state const p = particle_get(&t->particles, i);
        n += fabsf(m_wrap_pi(TWO_PI_F * (p.f[F_PHASE] - h->mean.phase))) < 0.5f * PI_F &&
             fabsf(m_wrap_pi(p.f[F_HEADING] - h->mean.heading)) < 0.5f * PI_F;
    }
    return n;
}

static void test_particles_follow_the_probabilities(void)
{
    gait_tracker_config const cfg = config();
    gait_hypothesis h[] = {other_way(0.5f), truth(0.3f), half_stride(0.2f), half_stride(0.004f)};
    gait_tracker *t = begin(&cfg, h, 4);
    CHECK(t->cfg.particles == cfg.acquisition_particles); /* while several compete */
    CHECK(abs(particles_of(t, &h[0]) - t->cfg.particles / 2) < 3);
    CHECK(abs(particles_of(t, &h[1]) - t->cfg.particles * 3 / 10) < 3);
    CHECK(abs(particles_of(t, &h[2]) - t->cfg.particles / 5) < 3);
    toy_tracker_free(t);
    h[1].in_place = 1;           /* cannot be tracked along with the first */
    h[2].mean.pelvis[0] += 1.0f; /* outside the region in which the first is searched for */
    t = begin(&cfg, h, 4);
    CHECK(particles_of(t, &h[0]) == t->cfg.particles);
    toy_tracker_free(t);
}

/* Particles of a hypothesis have its correlation; an invalid correlation is rejected. */
static void test_particles_are_correlated(void)
{
    enum { STATURE = 2, X = 4 };
    gait_tracker_config const cfg = config();
    gait_hypothesis h = truth(1.0f);
    h.correlation[X][STATURE] = h.correlation[STATURE][X] = -0.8f;
    gait_tracker *const t = begin(&cfg, &h, 1);
    double sum = 0.0, x = 0.0, tall = 0.0;
    for (int32_t i = 0; i < cfg.particles; i++) {
        particle_state const p = particle_get(&t->particles, i);
        double const dx = (double)((p.f[F_X] - h.mean.pelvis[0]) / h.sd.pelvis[0]),
                     ds = (double)((p.f[F_STATURE] - h.mean.stature) / h.sd.stature);
        sum += dx * ds;
        x += dx * dx;
        tall += ds * ds;
    }
    CHECK_NEAR(sum / sqrt(x * tall), -0.8, 0.15);
    CHECK_NEAR(tall / cfg.particles, 1.0, 0.4);
    h.correlation[X][STATURE] = 1.5f;
    CHECK(gait_tracker_start_hypotheses(t, &h, 1, 0, NULL) == GAIT_ERR_ARG);
    toy_tracker_free(t);
}

/* A start with a known phase leaves left and right open, as its keypoints may be swapped: the images decide. */
static void test_sides_are_open(void)
{
    for (int swapped = 0; swapped < 2; swapped++) {
        gait_tracker_config const cfg = config();
        gait_hypothesis const h = swapped ? half_stride(1.0f) : truth(1.0f);
        gait_tracker *const t = begin(&cfg, &h, 1);
        gait_estimate e;
        int tracked = 0, two = 0;
        for (int n = 0; n < FILM; n++) {
            gait_state const now = toy_walk((float)n / 30.0f);
            film_step(t, 1, n, 0, &e);
            bool const right = fabsf(m_wrap_pi(TWO_PI_F * (e.mean.phase - now.phase))) < 0.6f;
            CHECK(e.status != GAIT_TRACK_TRACKING || right);
            tracked += e.status == GAIT_TRACK_TRACKING;
            two += t->core->hypotheses.stage == HYPOTHESES_TWO;
        }
        CHECK(two > 10 && tracked > 30);
        toy_tracker_free(t);
    }
}

/* The correct hypothesis is the least probable one. */
static void test_images_choose(void)
{
    gait_tracker_config const cfg = config();
    gait_hypothesis const h[] = {half_stride(0.5f), other_way(0.3f), truth(0.2f)};
    gait_tracker *const t = begin(&cfg, h, 3);
    gait_estimate e;
    int tracked = 0;
    for (int n = 0; n < FRAMES; n++) {
        gait_state const now = toy_walk((float)n / 30.0f);
        film_step(t, 1, n, 0, &e);
        bool const right = fabsf(m_wrap_pi(TWO_PI_F * (e.mean.phase - now.phase))) < 0.6f &&
                           fabsf(m_wrap_pi(e.mean.heading - now.heading)) < 0.5f;
        tracked += e.status == GAIT_TRACK_TRACKING;
        CHECK(e.status == GAIT_TRACK_INIT || right);
    }
    CHECK(tracked > FRAMES - 24 && t->core->hypotheses.stage == HYPOTHESES_ONE);
    CHECK(t->cfg.particles == cfg.particles);
    toy_tracker_free(t);
}

/* Clouds without a background, in which every other frame looks like a person somewhere: started by hand, the tracker
 * reports `tracking` in most of them. */
static void test_no_person(void)
{
    static uint8_t cloud[SCENE_PIXELS];
    gait_tracker_config const cfg = config();
    gait_hypothesis const h[] = {half_stride(0.5f), truth(0.5f)};
    for (uint32_t seed = 0; seed < 4; seed++) {
        gait_tracker *const t = toy_tracker_new(&cfg);
        CHECK(gait_tracker_start_hypotheses(t, h, 1 + (int32_t)seed % 2, toy_frame(0).utime, NULL) ==
              GAIT_OK);
        for (int n = 0; n < FRAMES; n++) {
            const uint8_t *const shots[SCENE_CAMERAS] = {cloud};
            gait_estimate e;
            for (uint32_t i = 0; i < SCENE_PIXELS; i++)
                cloud[i] = (uint8_t)toy_cloud(100 * seed + (uint32_t)n / 2, i % SCENE_W, i / SCENE_W, 24);
            toy_tracker_step(t, n, shots, &e);
            CHECK(e.status == GAIT_TRACK_INIT || e.status == GAIT_TRACK_LOST);
        }
        toy_tracker_free(t);
    }
}

/* With an unknown phase, acquisition begins once the images show a person. */
static void test_open_phase(void)
{
    gait_tracker_config const cfg = config();
    gait_hypothesis h[] = {other_way(0.6f), truth(0.4f)};
    h[0].sd.phase = h[1].sd.phase = 0.5f;
    gait_tracker *const t = begin(&cfg, h, 2);
    gait_estimate e;
    CHECK(t->core->hypotheses.stage == HYPOTHESES_ACQUISITION && !t->core->hypotheses.left_right_known);
    for (int n = 0; n < FILM; n++) {
        film_step(t, 1, n, 0, &e);
        CHECK(n > 10 || e.status == GAIT_TRACK_INIT);
    }
    CHECK(t->core->found && fabsf(m_wrap_pi(e.mean.heading - toy_walk(0.0f).heading)) < 0.5f);
    toy_tracker_free(t);
}

static void refuse(gait_hypothesis h, int32_t count, const char *text)
{
    gait_tracker_config const cfg = config();
    gait_tracker *const t = toy_tracker_new(&cfg);
    gait_error err = {0};
    CHECK(gait_tracker_start_hypotheses(t, &h, count, 0, &err) == GAIT_ERR_ARG && strstr(err.text, text));
    CHECK(!t->core->started);
    toy_tracker_free(t);
}

static void test_refused(void)
{
    gait_hypothesis h = truth(-0.1f);
    refuse(h, 1, "hypothesis 0: probability");
    h.probability = NAN;
    refuse(h, 1, "probability");
    h.probability = 1.5f;
    refuse(h, 1, "probability");
    CHECK(gait_tracker_start_hypotheses(NULL, &h, 1, 0, NULL) == GAIT_ERR_ARG);
    gait_tracker_config const cfg = config();
    gait_tracker *const t = toy_tracker_new(&cfg);
    CHECK(gait_tracker_start_hypotheses(t, NULL, 1, 0, NULL) == GAIT_ERR_ARG);
    toy_tracker_free(t);
    h = truth(1.0f);
    refuse(h, 0, "count = 0 is outside [1, 8]");
    refuse(h, 9, "count = 9");
    h.mean.stature = 9.0f;
    refuse(h, 1, "stature");
    h = truth(1.0f);
    h.sd.phase = -1.0f;
    refuse(h, 1, "phase");
    CHECK(gait_tracker_start_hypotheses(NULL, &h, 1, 0, NULL) == GAIT_ERR_ARG);
}

static uint64_t digest(uint32_t cpu_mask)
{
    gait_tracker_config cfg = config();
    gait_hypothesis const h[] = {half_stride(0.5f), truth(0.3f), other_way(0.2f)};
    cfg.cpu_mask = cpu_mask;
    gait_tracker *const t = begin(&cfg, h, 3);
    gait_estimate e;
    for (int n = 0; n < 20; n++)
        film_step(t, 1, n, 0, &e);
    uint64_t const hash = gait_tracker_digest(t);
    toy_tracker_free(t);
    return hash;
}

#define GOLDEN UINT64_C(0xa07fb9742fdfc6d3)

static void tests(void)
{
    test_particles_follow_the_probabilities();
    test_particles_are_correlated();
    test_sides_are_open();
    test_images_choose();
    test_no_person();
    test_open_phase();
    test_refused();
}

int main(int argc, char **argv)
{
    film_make(1, FILM);
    return golden_main(argc, argv, tests, digest, GOLDEN, "start_hypotheses");
}
