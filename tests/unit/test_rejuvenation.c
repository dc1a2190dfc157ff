/* Rejuvenation keeps mean and covariance, removes the dependence on ancestors, and wraps angles. */
#include "filter/rejuvenation.h"
#include "base/fmath.h"

#include "base/rng.h"

#include "check.h"

enum { N = 4096, FIELDS = F_COEF + 2 };

typedef struct crowd {
    float value[FIELDS * N];
    int32_t parent[N];
} crowd;

static float rows[N * (FIELDS + 3)];

/* Normal particles, with correlated stature and x; phases and headings lie on both sides of their wrap. */
static particle_set normal_crowd(crowd *c)
{
    particle_set const p = {.n = N, .fields = FIELDS, .value = c->value};
    for (int32_t i = 0; i < N; i++) {
        float n[4];
        c->parent[i] = i;
        for (int32_t f = 0; f < FIELDS; f++) {
            rng_normal4(3, 90, 0, (uint32_t)i, (uint32_t)f, n);
            field(&p, f)[i] = n[0];
        }
        field(&p, F_PHASE)[i] = m_wrap1(0.01f * field(&p, F_PHASE)[i]);
        field(&p, F_HEADING)[i] = m_wrap_pi(PI_F + 0.05f * field(&p, F_HEADING)[i]);
        field(&p, F_STATURE)[i] = 1.7f + 0.01f * field(&p, F_STATURE)[i];
        field(&p, F_X)[i] = 3.0f + 5.0f * (field(&p, F_STATURE)[i] - 1.7f) + 0.01f * field(&p, F_X)[i];
    }
    return p;
}

static rejuvenation after(const particle_set *from, const crowd *c, float seconds, uint32_t frame)
{
    rejuvenation m = {
        .fields = FIELDS, .row = rows, .parent = c->parent, .n = N, .split = N, .seed = 11, .frame = frame};
    rejuvenation_rows(from, 0, N, rows);
    rejuvenation_set(&m, seconds, 1.0f);
    return m;
}

static void rejuvenate_all(const rejuvenation *m, crowd *out)
{
    particle_set to = {.n = N, .fields = FIELDS, .value = out->value};
    for (int32_t i = 0; i < N; i += BLOCK) {
        particle_block w;
        rejuvenate_block(m, i, i_min(BLOCK, N - i), &w);
        particle_block_put(&to, i, i_min(BLOCK, N - i), &w);
    }
}

/* Mean product of two fields about the means given. */
static double moment(const crowd *c, int32_t f, double mean_f, int32_t g, double mean_g)
{
    double sum = 0.0;
    for (int32_t i = 0; i < N; i++)
        sum += ((double)c->value[f * N + i] - mean_f) * ((double)c->value[g * N + i] - mean_g);
    return sum / N;
}

static double mean(const crowd *c, int32_t f)
{
    double sum = 0.0;
    for (int32_t i = 0; i < N; i++)
        sum += (double)c->value[f * N + i];
    return sum / N;
}

static double covariance(const crowd *c, int32_t f, int32_t g)
{
    return moment(c, f, mean(c, f), g, mean(c, g));
}

static crowd first, second;

/* After fifty times a twentieth of a second the moments are unchanged, and particles hardly depend on what they were. */
static void test_mean_and_covariance_remain(void)
{
    particle_set const from = normal_crowd(&first);
    double const stature = mean(&first, F_STATURE), variance = covariance(&first, F_STATURE, F_STATURE);
    double const both = covariance(&first, F_STATURE, F_X), score = covariance(&first, F_COEF, F_COEF);
    static crowd start;
    start = first;
    for (uint32_t k = 0; k < 50; k++) {
        rejuvenation const m = after(&from, &first, 0.05f, k);
        rejuvenate_all(&m, &second);
        memcpy(first.value, second.value, sizeof first.value);
    }
    CHECK_NEAR(mean(&first, F_STATURE), stature, 0.1 * 0.01);
    CHECK_NEAR(covariance(&first, F_STATURE, F_STATURE) / variance, 1.0, 0.15);
    CHECK_NEAR(covariance(&first, F_STATURE, F_X) / both, 1.0, 0.15);
    CHECK_NEAR(covariance(&first, F_COEF, F_COEF) / score, 1.0, 0.15);
    double shared = 0.0; /* a correlation of exp(-2.5) is left */
    for (int32_t i = 0; i < N; i++)
        shared += ((double)first.value[F_STATURE * N + i] - stature) *
                  ((double)start.value[F_STATURE * N + i] - stature);
    CHECK_NEAR(shared / N / variance, 0.082, 0.06);
}

/* However much time has passed, particles keep half of what they were and do not become copies of others. */
static void test_half_remains(void)
{
    particle_set const from = normal_crowd(&first);
    double const stature = mean(&first, F_STATURE), variance = covariance(&first, F_STATURE, F_STATURE);
    rejuvenation const m = after(&from, &first, 100.0f, 0);
    double shared = 0.0;
    rejuvenate_all(&m, &second);
    for (int32_t i = 0; i < N; i++)
        shared += ((double)first.value[F_STATURE * N + i] - stature) *
                  ((double)second.value[F_STATURE * N + i] - stature);
    CHECK_NEAR(shared / N / variance, 0.5, 0.05);
    CHECK_NEAR(covariance(&second, F_STATURE, F_STATURE) / variance, 1.0, 0.15);
}

static void test_angles_go_the_short_way(void)
{
    particle_set const from = normal_crowd(&first);
    rejuvenation const m = after(&from, &first, 0.5f, 0);
    rejuvenate_all(&m, &second);
    for (int32_t i = 0; i < N; i++) {
        float const phase = TWO_PI_F * second.value[F_PHASE * N + i],
                    heading = second.value[F_HEADING * N + i];
        CHECK(fabsf(m_wrap_pi(phase)) < TWO_PI_F * 0.1f);
        CHECK(fabsf(m_wrap_pi(heading - PI_F)) < 0.5f);
    }
}

/* By weight: a particle without descendants is never drawn. */
static void test_others_are_drawn_by_weight(void)
{
    particle_set const from = normal_crowd(&first);
    for (int32_t i = 0; i < N; i++) {
        first.parent[i] = i % 7;
        if (i >= 7)
            field(&from, F_STATURE)[i] = 1000.0f;
    }
    rejuvenation const m = after(&from, &first, 0.5f, 0);
    rejuvenate_all(&m, &second);
    for (int32_t i = 0; i < N; i++)
        CHECK(second.value[F_STATURE * N + i] < 2.0f);
}

/* Two hypotheses far apart are not mixed. */
static void test_hypotheses_are_rejuvenated_separately(void)
{
    particle_set const from = normal_crowd(&first);
    for (int32_t i = 0; i < N; i++) {
        first.parent[i] = i;
        field(&from, F_STATURE)[i] = i < N / 3 ? 1.0f : 1000.0f;
    }
    rejuvenation m = after(&from, &first, 0.5f, 0);
    m.split = N / 3;
    rejuvenate_all(&m, &second);
    for (int32_t i = 0; i < N; i++)
        CHECK_NEAR(second.value[F_STATURE * N + i], i < N / 3 ? 1.0 : 1000.0, 1e-3);
}

static void test_nothing_changes_without_time(void)
{
    particle_set const from = normal_crowd(&first);
    rejuvenation never = after(&from, &first, 0.5f, 0);
    rejuvenation const none = after(&from, &first, 0.0f, 0);
    rejuvenation_set(&never, 0.5f, 0.0f);
    rejuvenate_all(&none, &second);
    CHECK(memcmp(first.value, second.value, sizeof first.value) == 0);
    rejuvenate_all(&never, &second);
    CHECK(memcmp(first.value, second.value, sizeof first.value) == 0);
}

/* Wherever the block begins, and however many of its lanes are in use. */
static void test_lanes_beyond_repeat_the_last(void)
{
    particle_set const from = normal_crowd(&first);
    rejuvenation const m = after(&from, &first, 0.5f, 0);
    particle_block whole, part;
    rejuvenate_block(&m, 5, BLOCK, &whole);
    rejuvenate_block(&m, 7, 3, &part);
    for (int32_t f = 0; f < FIELDS; f++)
        for (int32_t lane = 0; lane < BLOCK; lane++)
            CHECK(part.f[f][lane] == whole.f[f][2 + i_min(lane, 2)]);
}

int main(void)
{
    test_lanes_beyond_repeat_the_last();
    test_mean_and_covariance_remain();
    test_half_remains();
    test_angles_go_the_short_way();
    test_others_are_drawn_by_weight();
    test_hypotheses_are_rejuvenated_separately();
    test_nothing_changes_without_time();
    return CHECK_DONE();
}
