/* Foreground against the body, by counting cells one by one. */
#include "toy_body.h"

#include "base/rng.h"

#include "check.h"

static layers body;

static void random_words(uint32_t draw, uint64_t (*out)[GRID_WORDS])
{
    for (uint32_t y = 0; y < GRID_SIZE; y++) {
        uint32_t r[4];
        rng_bits(8, 0, 0, y, draw, r);
        out[y][0] = (uint64_t)r[0] << 32 | r[1];
        out[y][1] = (uint64_t)r[2] << 32 | r[3];
    }
}

static int32_t bit(const uint64_t (*m)[GRID_WORDS], int32_t x, int32_t y)
{
    return (int32_t)(m[y][x >> 6] >> (x & 63) & 1);
}

/* Any foreground, body and field of view: background inside + missed_weight x foreground outside, over the area of
 * a typical person (0.16 x 96 x 96 cells). */
static void test_counts(void)
{
    toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    double const typical = 0.16 * 96.0 * 96.0;
    uint64_t drawn[GRID_SIZE][GRID_WORDS];
    for (uint32_t round = 0; round < 20; round++) {
        double inside = 0.0, outside = 0.0, under = 0.0;
        int32_t const first = (int32_t)(6 * round), last = i_min(first + 40, GRID_SIZE);
        random_words(8 * round, v->f.inside);
        random_words(8 * round + 1, drawn);
        for (uint32_t y = 0; y < GRID_SIZE; y++) /* rows outside [first, last) hold leftovers */
            for (int32_t w = 0; w < GRID_WORDS; w++)
                body.whole.word[w][y] = drawn[y][w];
        body.whole.width = GRID_SIZE;
        for (uint32_t k = 0; k < FOREGROUND_PLANES; k++)
            random_words(8 * round + 2 + k, v->f.foreground[k]);
        body.whole.first = first;
        body.whole.last = last;
        v->f.has_foreground = true;
        v->f.foreground_total = 0;
        for (int32_t y = 0; y < GRID_SIZE; y++)
            for (int32_t x = 0; x < GRID_SIZE; x++) {
                int32_t p = 0;
                for (int32_t k = 0; k < FOREGROUND_PLANES; k++) {
                    v->f.foreground[k][y][x >> 6] &= v->f.inside[y][x >> 6];
                    p |= bit((const uint64_t (*)[GRID_WORDS])v->f.foreground[k], x, y) << k;
                }
                bool const see = bit((const uint64_t (*)[GRID_WORDS])v->f.inside, x, y);
                bool const in = y >= first && y < last && bit((const uint64_t (*)[GRID_WORDS])drawn, x, y);
                v->f.foreground_total += p;
                inside += see && in ? 1.0 - p / 15.0 : 0.0;
                under += see && in ? p / 15.0 : 0.0;
                outside += see && !in ? p / 15.0 : 0.0;
            }
        v->setup.missed_weight = 0.05f * (float)round;
        like_body b = {.setup = &v->setup, .features = &v->f, .layers = &body};
        double const missed = (double)v->setup.missed_weight,
                     nats = (double)v->setup.weight[1] * missed / typical;
        features_words(&v->f);
        like_silhouette_count(&b);
        like_parts const parts = like_silhouette_parts(&b);
        CHECK_NEAR(parts.explained, nats * under, 1e-3);
        CHECK_NEAR(parts.missed, nats * outside, 1e-3);
        CHECK_NEAR(like_silhouette.log_likelihood(&b), -(inside + missed * outside) / typical, 1e-4);
        CHECK_NEAR(like_silhouette.support(&b), (missed * under - inside) / typical, 1e-4);
    }
}

/* Where all is foreground, a body anywhere is full of it: that is no support. */
static void test_foreground_everywhere(void)
{
    toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    body.whole = (grid_mask){.width = GRID_SIZE, .first = 20, .last = 60};
    for (int32_t y = 20; y < 60; y++)
        body.whole.word[0][y] = ~UINT64_C(0);
    for (int32_t full = 0; full < 2; full++) { /* the whole image, and the body alone */
        v->f.foreground_total = 0;
        for (int32_t y = 0; y < GRID_SIZE; y++)
            for (int32_t w = 0; w < GRID_WORDS; w++) {
                v->f.inside[y][w] = ~UINT64_C(0);
                for (int32_t k = 0; k < FOREGROUND_PLANES; k++) {
                    bool const in = y >= 20 && y < 60 && w == 0;
                    v->f.foreground[k][y][w] = in || full ? ~UINT64_C(0) : 0;
                    v->f.foreground_total += in || full ? 64 << k : 0;
                }
            }
        v->f.has_foreground = true;
        like_body b = {.setup = &v->setup, .features = &v->f, .layers = &body};
        features_words(&v->f);
        like_silhouette_count(&b);
        double const alone = (double)v->setup.missed_weight * 40.0 * 64.0 / (0.16 * 96.0 * 96.0);
        CHECK_NEAR(like_silhouette.support(&b), full ? 0.0 : alone, 1e-4);
    }
}

/* Without a plate the term is 0. */
static void test_silent(void)
{
    toy_body *const v = toy_body_new(0, GAIT_MODE_DEFAULT);
    like_body b = {.setup = &v->setup, .features = &v->f, .layers = &body};
    v->f.has_foreground = false;
    like_silhouette_count(&b);
    CHECK(like_silhouette_parts(&b).explained == 0.0f && like_silhouette_parts(&b).missed == 0.0f);
    CHECK(like_silhouette.log_likelihood(&b) == 0.0f && like_silhouette.support(&b) == 0.0f);
    CHECK(like_silhouette.flag == GAIT_TERM_SILHOUETTE);
}

/* The person in front of the wall: nearly all of the area is found, and hardly anything else. */
static void test_scene(void)
{
    static uint8_t wall[SCENE_PIXELS], shot[SCENE_PIXELS];
    for (int camera = 0; camera < SCENE_CAMERAS; camera++) {
        toy_body *const v = toy_body_new(camera, GAIT_MODE_DEFAULT);
        gait_state const s = toy_walk(1.0f);
        toy_wall(camera, wall);
        toy_shot(camera, 30, shot);
        toy_body_aim(v, &s);
        toy_body_at(v, shot, wall);
        like_body const b = toy_body_body(v, &s);
        CHECK(like_silhouette.log_likelihood(&b) > -0.3f);
        CHECK(like_silhouette.support(&b) > 0.1f);
        gait_state away = s;
        away.pelvis[0] += 0.6f; /* both wrong: the body on the wall, the person unexplained */
        away.pelvis[1] += 0.4f;
        like_body const c = toy_body_body(v, &away);
        CHECK(like_silhouette.log_likelihood(&c) < -0.7f);
        CHECK(like_silhouette.support(&c) < -0.3f);
    }
}

int main(void)
{
    test_counts();
    test_foreground_everywhere();
    test_silent();
    test_scene();
    return CHECK_DONE();
}
