/* Track loss and recovery: an empty scene, an occluded person, reappearance where expected or elsewhere. */
#include "tracker/track_loss.h"

#include "tracker/fit_check.h"
#include "tracker/front_back.h"
#include "kernel_check.h"
#include "base/fmath.h"
#include "base/rng.h"
#include "toy_film.h"

#include "check.h"

/* The picture of film frame `shown`, or the empty scene if negative, at time n. */
static void show(gait_tracker *t, int n, int shown, gait_estimate *e)
{
    const uint8_t *const shots[SCENE_CAMERAS] = {shown < 0 ? film_wall[0] : film[0][shown], NULL};
    toy_tracker_step(t, n, shots, e);
}

enum { POST = 14 }; /* half its width, pixels */

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

/* In the empty scene the status is never tracking. */
static void test_empty_scene(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    for (int n = 0; n < 60; n++) {
        show(t, n, -1, &e);
        CHECK(e.status == (n < 10 ? GAIT_TRACK_INIT : GAIT_TRACK_LOST));
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
    CHECK(e.status == GAIT_TRACK_TRACKING && !track_loss_is_lost(t));
    for (int n = 20; n < 45; n++) {
        show(t, n, -1, &e);
        CHECK((e.status == GAIT_TRACK_LOST) == (n >= 29) && track_loss_is_lost(t) == (n >= 29));
        CHECK(!t->core->partly_hidden);
    }
    for (int n = 45; n < 60; n++) {
        show(t, n, n, &e);
        CHECK(e.status == GAIT_TRACK_TRACKING || n < 48);
    }
    double const phase = (double)(e.mean.phase - toy_walk(59.0f / 30.0f).phase);
    CHECK_NEAR(phase - floor(phase + 0.5), 0.0, 0.03);
    CHECK(off(&e, 59) < 0.1);
    toy_tracker_free(t);
}

/* Frame n behind a post at x metres, half as wide as a body; the empty scene also has the post. */
static const uint8_t *behind_post(int n, float x)
{
    static uint8_t picture[SCENE_PIXELS];
    gait_camera const cam = toy_camera(0);
    float const point[3] = {x, 0, 1};
    float at[2] = {0};
    camera_project(&cam, point, at);
    memcpy(picture, film[0][n], SCENE_PIXELS);
    for (int y = 0; y < SCENE_H; y++)
        for (int u = (int)at[0] - POST; u <= (int)at[0] + POST; u++)
            picture[y * SCENE_W + u] = film_wall[0][y * SCENE_W + u];
    return picture;
}

/* A person behind a post, beside which a leg or an arm appears now and then, is followed and never reported as lost,
 * although the whole body has no support for longer than a person may be hidden. */
static void test_hidden_in_part(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    int untracked = 0, parts = 0;
    for (int n = 0; n < 60; n++) {
        const uint8_t *const shots[SCENE_CAMERAS] = {behind_post(n, toy_walk(1.0f).pelvis[0]), NULL};
        toy_tracker_step(t, n, shots, &e);
        untracked += e.status != GAIT_TRACK_TRACKING && n > 10;
        parts += t->core->partly_hidden;
    }
    CHECK(untracked == 0);
    CHECK(parts >= 5);
    CHECK(off(&e, 59) < 0.1);
    toy_tracker_free(t);
}

/* The empty scene with a dark screen carried past, x metres along the path. */
static const uint8_t *screen_behind(float x)
{
    static uint8_t picture[SCENE_PIXELS];
    gait_camera const cam = toy_camera(0);
    float const point[3] = {x, 0, 1};
    float at[2] = {0};
    camera_project(&cam, point, at);
    memcpy(picture, film_wall[0], SCENE_PIXELS);
    for (int y = 60; y < 250; y++)
        for (int u = i_max((int)at[0] - 5 * POST, 0); u <= (int)at[0]; u++)
            picture[y * SCENE_W + u] = 20;
    return picture;
}

/* Something else that the body covers in part does not count as visible parts of the person: more is
 * left unexplained than before. */
static void test_something_else(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    int parts = 0;
    for (int n = 0; n < 50; n++) {
        const uint8_t *const shots[SCENE_CAMERAS] = {
            n < 20 ? film[0][n] : screen_behind(toy_walk((float)n / 30.0f).pelvis[0]), NULL};
        toy_tracker_step(t, n, shots, &e);
        parts += t->core->partly_hidden;
    }
    CHECK(parts == 0);
    toy_tracker_free(t);
}

/* A person who reappears further on and in another phase than predicted is found by redrawn particles; if that changes the
 * phase, left and right are open.  Whether it does depends on the draws. */
static void test_elsewhere(void)
{
    enum { SEEDS = 16 };
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
            open += e.status == GAIT_TRACK_INIT;
        }
        found += e.status != GAIT_TRACK_LOST && off(&e, 63) < 0.5;
        careful += open > 5;
        toy_tracker_free(t);
    }
    CHECK(found >= SEEDS - 4);
    CHECK(careful >= 2);
}

/* Mean x of the particles that are redrawn when the person has been lost for a second. */
static double sought_at(double belt)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    double sum = 0.0;
    int redrawn = 0;
    t->cfg.belt = belt;
    show(t, 0, 0, &e);
    t->core->utime += 1000000;
    track_loss_redraw(t, 0);
    for (int32_t i = 0; i < t->cfg.particles; i += 8, redrawn++)
        sum += (double)particle_get(&t->particles, i).f[F_X];
    toy_tracker_free(t);
    return sum / redrawn;
}

/* A person on a belt is searched for where they were lost, a person on the floor a second's walk ahead. */
static void test_belt(void)
{
    double const ahead = (double)(toy_walk(1.0f).pelvis[0] - toy_walk(0.0f).pelvis[0]);
    double const belt = sought_at(1.0), floor_x = sought_at(0.0);
    CHECK_NEAR(belt, (double)toy_walk(0.0f).pelvis[0], 0.2);
    CHECK_NEAR((floor_x - belt) / ahead, 1.0, 0.1);
}

/* From a side the image supports the estimate and not the same turned by 180 degrees; from in front it supports neither.
 * The running mean decides, and recovers. */
static void test_front_back(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    for (int n = 0; n < 30; n++) {
        show(t, n, n, &e);
        CHECK(t->core->front_back_margin >= 0.0f && e.status == GAIT_TRACK_TRACKING);
    }
    particle_state const right = particle_from_state(&t->layout, &e.mean);
    particle_state turned = right, away = right;
    turned.f[F_HEADING] = m_wrap_pi(turned.f[F_HEADING] + PI_F);
    away.f[F_HEADING] = 0.5f * PI_F;
    CHECK(front_back_score(t, &t->layout, &right) > 0.01f &&
          front_back_score(t, &t->layout, &turned) < -0.01f);
    CHECK(front_back_score(t, &t->layout, &away) == 0.0f);
    t->core->front_back_margin = -0.02f;
    show(t, 30, 30, &e);
    CHECK(t->core->front_back_margin < 0.0f && e.status == GAIT_TRACK_AMBIGUOUS);
    for (int n = 31; n < 60; n++)
        show(t, n, n, &e);
    CHECK(t->core->front_back_margin >= 0.0f && e.status == GAIT_TRACK_TRACKING);
    toy_tracker_free(t);
}

/* The images prefer the estimate to different bodies, and nothing but it.  The running mean decides, and recovers. */
static void test_fit(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    for (int n = 0; n < 30; n++) {
        show(t, n, n, &e);
        CHECK(t->core->fit_margin >= 0.0f && e.status == GAIT_TRACK_TRACKING);
    }
    particle_state const right = particle_from_state(&t->layout, &e.mean);
    particle_state turned = right, late = right;
    turned.f[F_HEADING] = m_wrap_pi(right.f[F_HEADING] + PI_F / 3.0f);
    late.f[F_PHASE] = m_wrap1(right.f[F_PHASE] - 0.25f);
    CHECK(fit_check_score(t, &t->layout, &right) > 1.0f);
    CHECK(fit_check_score(t, &t->layout, &turned) < -1.0f && fit_check_score(t, &t->layout, &late) < -1.0f);
    t->core->fit_margin = -0.5f;
    show(t, 30, 30, &e);
    CHECK(t->core->fit_margin < 0.0f && e.status == GAIT_TRACK_AMBIGUOUS && (e.flags & GAIT_EST_OTHERS_FIT));
    for (int n = 31; n < 60; n++)
        show(t, n, n, &e);
    CHECK(t->core->fit_margin >= 0.0f && e.status == GAIT_TRACK_TRACKING && !(e.flags & GAIT_EST_OTHERS_FIT));
    toy_tracker_free(t);
}

/* One bad frame in a row of good ones changes little, a row of bad ones much. */
static void test_fit_is_averaged(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    for (int n = 0; n < 30; n++)
        show(t, n, n, &e);
    particle_state const right = particle_from_state(&t->layout, &e.mean);
    particle_state turned = right;
    turned.f[F_HEADING] = m_wrap_pi(right.f[F_HEADING] + PI_F / 3.0f);
    t->core->support_utime = t->core->utime - 40000;
    float const good = t->core->fit_margin, once = fit_check_update(t, false, &t->layout, &turned);
    CHECK(once > 0.0f && once < good);
    for (int n = 0; n < 25; n++)
        t->core->fit_margin = fit_check_update(t, false, &t->layout, &turned);
    CHECK(t->core->fit_margin < 0.0f);
    CHECK(fit_check_update(t, true, &t->layout, &turned) > 0.0f);
    t->cfg.mode = GAIT_MODE_PAPER; /* has no such check */
    t->core->fit_margin = 0.25f;
    CHECK(fit_check_update(t, false, &t->layout, &turned) == 0.25f);
    toy_tracker_free(t);
}

/* The likelihood of no particle is below that of a hidden person. */
static void test_the_bound(void)
{
    gait_tracker *const t = begin();
    gait_estimate e;
    double lowest = 1e9, highest = -1e9, least = 1e9;
    show(t, 0, 0, &e);
    for (int32_t i = 0; i < 600; i++) {
        lowest = fmin(lowest, (double)t->loglik_raw[i]);
        highest = fmax(highest, (double)t->loglik_raw[i]);
        least = fmin(least, (double)t->loglik[i]);
        CHECK(t->loglik[i] >= t->loglik_raw[i]);
    }
    CHECK(lowest < highest - 10.0 && least > lowest && least < highest);
    toy_tracker_free(t);
}

/* The log of a sum of two, for any number at any address: close to the C library's, with the same bits from every
 * instruction set. */
static void test_join(void)
{
    enum { MOST = 150 };
    static const float special[] = {NAN, INFINITY, -INFINITY, 0.0f, -1e30f, -3.0f, 88.0f, FLT_MAX};
    static _Alignas(GAIT_ALIGN) unsigned char memory[MOST * sizeof(float) + 2 * GUARD + 16];
    float buffer[MOST + 3], part[MOST], want[MOST];
    int32_t wrong = 0, far = 0;
    for (int32_t n = 0; n <= MOST; n++) {
        float const b = -50.0f + (float)n;
        float *const a = buffer + n % 4;
        for (int32_t i = 0; i < n; i++) {
            uint32_t r[4];
            rng_bits(3, 0, (uint32_t)n, (uint32_t)i, 0, r);
            a[i] = r[1] % 8 ? -100.0f + 0.001f * (float)(r[0] % 150000) : special[r[2] % 8];
            part[i] = want[i] = 0.01f * (float)(r[3] % 1000);
        }
        isa_scalar()->track_loss_join(a, b, n, want);
        for (int32_t i = 0; i < n; i++) {
            double const hidden = exp((double)b + (double)part[i]);
            far +=
                a[i] > -1e3f && a[i] < 1e3f && fabs((double)want[i] - log(exp((double)a[i]) + hidden)) > 1e-5;
        }
        for (int k = 0; k < isa_count(); k++) {
            guarded const g =
                guard_fill(memory + (size_t)(n / 4 % 4) * sizeof(float), (size_t)n * sizeof(float));
            memcpy(g.begin, part, g.bytes);
            isa_at(k)->track_loss_join(a, b, n, (float *)(void *)g.begin);
            wrong += !guard_whole(&g) || memcmp(g.begin, want, g.bytes) != 0;
        }
    }
    CHECK(wrong == 0 && far == 0);
}

int main(void)
{
    test_join();
    film_make(1, 64);
    test_empty_scene();
    test_hidden();
    test_hidden_in_part();
    test_something_else();
    test_elsewhere();
    test_belt();
    test_front_back();
    test_fit();
    test_fit_is_averaged();
    test_the_bound();
    return CHECK_DONE();
}
