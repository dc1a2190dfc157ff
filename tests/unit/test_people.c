/* People of the automatic start: the hypotheses of all of them, statures from boxes, people who have left. */
#include "start/people.h"

#include "check.h"

static const gait_camera CAMERA = {320,          180, 250, 250, 160, 90, {1, 0, 0, 0, 0, -1, 0, 1, 0},
                                   {0, 1.5f, 0}, {0}};

static gait_hypothesis hypothesis(float probability, int32_t in_place)
{
    return (gait_hypothesis){.probability = probability, .in_place = in_place};
}

/* The most probable first, at most as many as fit; those who walk before those who stand. */
static void test_merge(void)
{
    gait_hypothesis all[GAIT_START_MAX_HYPOTHESES], own[2];
    int32_t n = 0;
    for (int k = 0; k < 2 * GAIT_START_MAX_HYPOTHESES; k++) {
        int const rank = k * 7 % (2 * GAIT_START_MAX_HYPOTHESES); /* in no order */
        own[0] = hypothesis(0.01f * (float)(rank + 1), 0);
        own[1] = hypothesis(1e-6f, 0);
        n = people_merge(all, n, own, 1 + k % 2, 10);
    }
    CHECK(n == GAIT_START_MAX_HYPOTHESES);
    for (int k = 0; k < n; k++)
        CHECK_NEAR(all[k].probability, 0.1 * (2 * GAIT_START_MAX_HYPOTHESES - k), 1e-6);
    CHECK(people_normalise(all, n) == n);
    double sum = 0.0;
    for (int k = 0; k < n; k++)
        sum += (double)all[k].probability;
    CHECK_NEAR(sum, 1.0, 1e-6);
    own[0] = hypothesis(0.5f, 1);
    own[1] = hypothesis(0.5f, 0);
    n = people_merge(all, 0, own, 2, 10);
    CHECK(n == 2 && !all[0].in_place && all[1].in_place);
}

/* Box of a person of this stature, `away` metres in front of the camera. */
static gait_box box(double x, double away, double stature)
{
    float const u = (float)(160 + 250 * x / away);
    return (gait_box){.foot = {u, (float)(90 + 250 * 1.5 / away)},
                      .head = {u, (float)(90 + 250 * (1.5 - stature) / away)},
                      .sd = 1};
}

static void test_stature(void)
{
    static const double statures[] = {1.3, 1.5, 1.7, 1.9};
    start_box b;
    for (int i = 0; i < 4; i++) {
        gait_box const of = box(0.5, 4 + i, statures[i]);
        CHECK(people_box(&CAMERA, &of, &b));
        CHECK_NEAR(people_stature(&CAMERA, &b), statures[i], 1e-5);
    }
    gait_camera below = CAMERA;
    below.t[1] = -1;
    gait_box const of = box(0, 4, 1.7);
    CHECK(people_box(&below, &of, &b) && isnan(people_stature(&below, &b)));
    gait_box flying = of; /* feet above the horizon */
    flying.foot[1] = 80;
    CHECK(people_box(&CAMERA, &flying, &b) && isnan(people_stature(&CAMERA, &b)));
}

static int people(const start_people *p)
{
    int count = 0;
    for (int k = 0; k < GAIT_START_MAX_PEOPLE; k++)
        count += p->person[k].count > 0;
    return count;
}

static void test_people(void)
{
    static start_people p;
    gait_box b[GAIT_START_MAX_PEOPLE + 1];
    for (int k = 0; k <= GAIT_START_MAX_PEOPLE; k++)
        b[k] = box(-2.0 + k, 5, 1.7);
    people_add(&p, &CAMERA, 0, b, GAIT_START_MAX_PEOPLE + 1); /* one too many */
    CHECK(people(&p) == GAIT_START_MAX_PEOPLE && p.begun);
    people_add(&p, &CAMERA, START_KEEP, b, 1);
    CHECK(people(&p) == GAIT_START_MAX_PEOPLE && p.person[0].count == 2);
    people_add(&p, &CAMERA, START_KEEP + 1, b, 0);
    CHECK(people(&p) == 1); /* the others have left */
    b[0] = box(0, 5, 3.5);  /* no person */
    b[1] = b[2] = box(1, 5, 1.7);
    b[2].head[1] = b[2].foot[1] - 0.5f;
    people_add(&p, &CAMERA, START_KEEP + 2, b, 3);
    CHECK(people(&p) == 2);
    for (int k = 0; k < 3 * GAIT_START_MAX_FRAMES; k++)
        people_add(&p, &CAMERA, START_KEEP + 40000 * (k + 1), &b[1], 1);
    CHECK(people(&p) == 1); /* 7.7 s, longer than the other is kept */
}

int main(void)
{
    test_merge();
    test_stature();
    test_people();
    return CHECK_DONE();
}
