/* Paper mode notices when the surface under the body does not move with it, and when it does again. */
#include "tracker/tracker.h"
#include "tracker/walk_check.h"

#include "toy_film.h"

#include "check.h"

enum { FRAMES = 64, EMPTY = 34 };

/* Particles that walk on from the truth, whatever the pictures show. */
static gait_tracker_config walking_on(void)
{
    gait_tracker_config cfg = toy_config(1);
    cfg.mode = GAIT_MODE_PAPER;
    cfg.terms = GAIT_TERM_TEXTURE;
    cfg.texture_weight = 1.0f;
    cfg.particles = 32;
    cfg.phase_noise = cfg.rate_noise = cfg.forward_noise = cfg.lateral_noise = cfg.vertical_noise = 0.0f;
    cfg.heading_noise = cfg.tilt_noise = cfg.coef_noise = cfg.stature_noise = cfg.stature_noise_start = 0.0f;
    cfg.rate_time = cfg.tilt_time = cfg.coef_time = 0.0f;
    return cfg;
}

/* Statuses of the frames; the person is there from frame `enters` on. */
static void follow(const gait_tracker_config *cfg, int enters, int32_t status[FRAMES], float *least,
                   float *most)
{
    gait_tracker *const t = film_tracker(cfg, 0, 0.01f);
    *least = 1e9f;
    *most = -1e9f;
    for (int n = 0; n < FRAMES; n++) {
        gait_estimate e;
        const uint8_t *const shot[] = {n < enters ? film_wall[0] : film[0][n], NULL};
        toy_tracker_step(t, n, shot, &e);
        status[n] = (int32_t)e.status;
        if (t->walk_check && t->walk_check->judged) {
            *least = f_min(*least, t->walk_check->nats);
            *most = f_max(*most, t->walk_check->nats);
        }
    }
    toy_tracker_free(t);
}

static int lost(const int32_t status[FRAMES], int from, int to)
{
    int count = 0;
    for (int n = from; n < to; n++)
        count += status[n] == GAIT_TRACK_LOST;
    return count;
}

static void test_a_person_walks_with_the_body(void)
{
    gait_tracker_config const cfg = walking_on();
    int32_t status[FRAMES];
    float least, most;
    follow(&cfg, 0, status, &least, &most);
    CHECK(least > 15.0f && lost(status, 0, FRAMES) == 0); /* elsewhere the surface is not found again */
}

/* On the wall the likelihood is as high as on the person; the check reports the track as lost within a second, and as found
 * when the person is back. */
static void test_a_wall_stays(void)
{
    gait_tracker_config cfg = walking_on();
    int32_t status[FRAMES];
    float least, most;
    follow(&cfg, EMPTY, status, &least, &most);
    CHECK(least < -cfg.stayed_nats && most > 0.0f);
    CHECK(lost(status, 0, 10) == 0 && lost(status, 30, EMPTY) == EMPTY - 30);
    CHECK(lost(status, FRAMES - 8, FRAMES) == 0);
    cfg.stayed_nats = 0.0f;
    follow(&cfg, EMPTY, status, &least, &most);
    CHECK(lost(status, 0, FRAMES) == 0);
}

/* Frames too far apart are not compared, and the default mode has no such state. */
static void test_when(void)
{
    gait_tracker_config cfg = walking_on();
    gait_tracker *t = film_tracker(&cfg, 0, 0.01f);
    gait_estimate e;
    static const int at[] = {0, 3, 5}, late[] = {18, 24};
    for (size_t k = 0; k < sizeof at / sizeof *at; k++)
        film_step(t, 1, at[k], 0, &e);
    CHECK(t->walk_check->age == 0 && !t->walk_check->judged && walk_check_passes(t));
    for (size_t k = 0; k < sizeof late / sizeof *late; k++) {
        film_step(t, 1, late[k], 0, &e);
        CHECK(!t->walk_check->judged == (k == 0) && t->walk_check->age > 0);
    }
    toy_tracker_free(t);
    cfg = toy_config(1);
    t = film_tracker(&cfg, 0, 1.0f);
    CHECK(!t->walk_check && walk_check_passes(t));
    toy_tracker_free(t);
}

int main(void)
{
    film_make(1, FRAMES);
    test_a_person_walks_with_the_body();
    test_a_wall_stays();
    test_when();
    return CHECK_DONE();
}
