/* Strides from estimates: times and lengths of a known walk, a fluctuating phase, missed strikes, uncertainty, restarts. */
#include "../../tools/trackd/strides.c"
#include "check.h"

enum { FRAMES = 200, MOST = 20 };

/* A walk of 0.8 strides per second and 1.25 m/s along an oblique line, at 25 frames per second. */
static gait_estimate walk(int n)
{
    double const t = 0.04 * n;
    gait_estimate e = {.utime = 1000000000 + 40000 * (int64_t)n, .status = GAIT_TRACK_TRACKING};
    e.mean.phase = (float)fmod(0.3 + 0.8 * t, 1.0);
    e.mean.stride_hz = 0.8f;
    e.sd.phase = 0.008f;
    e.pose.joint[0][0] = (float)(0.75 * t);
    e.pose.joint[0][1] = (float)(1.0 * t);
    e.joint_sd[0][0] = e.joint_sd[0][1] = 0.01f;
    return e;
}

/* Strides of frames [from, to) into out; `change` may alter an estimate before it is taken in. */
static int strides(stride_meter *m, int from, int to, void (*change)(int n, gait_estimate *e),
                   stride out[MOST])
{
    int count = 0;
    for (int n = from; n < to; n++) {
        gait_estimate e = walk(n);
        if (change)
            change(n, &e);
        if (stride_meter_add(m, &e, &out[count]) && count < MOST - 1)
            count++;
    }
    return count;
}

static void test_a_known_walk(void)
{
    stride_meter m = {0};
    stride s[MOST];
    int const count = strides(&m, 0, FRAMES, NULL, s);
    CHECK(count == 11); /* left strikes at 0.25 s, right ones at 0.875 s, each every 1.25 s, until 7.96 s */
    for (int k = 0; k < count; k++) {
        double const end = (k % 2 ? 2.125 : 1.5) + 1.25 * (k / 2);
        CHECK(s[k].side == (k % 2 ? STRIDE_RIGHT : STRIDE_LEFT) && s[k].sure);
        CHECK_NEAR(s[k].utime - 1000000000, 1e6 * end, 200);
        CHECK_NEAR(s[k].start_utime - 1000000000, 1e6 * (end - 1.25), 200);
        CHECK_NEAR(s[k].other_utime - 1000000000, 1e6 * (end - 0.625), 200);
        CHECK_NEAR(s[k].time, 1.25, 1e-3);
        CHECK_NEAR(s[k].cadence, 96.0, 0.1);
        CHECK_NEAR(s[k].length, 1.5625, 2e-3);
        CHECK_NEAR(s[k].speed, 1.25, 2e-3);
        CHECK_NEAR(s[k].end_sd, 0.01, 1e-5);
        CHECK_NEAR(s[k].start_sd, 0.01, 1e-5);
        CHECK_NEAR(s[k].other_sd, 0.01, 1e-5);
        CHECK_NEAR(s[k].time_sd, 0.01 * sqrt(2.0), 1e-5);
        CHECK_NEAR(s[k].cadence_sd, 96.0 * 0.01 * sqrt(2.0) / 1.25, 1e-3);
        CHECK_NEAR(s[k].length_sd, 0.01 * sqrt(2.0), 1e-5);
        CHECK_NEAR(s[k].speed_sd, hypot(0.01 * sqrt(2.0), 1.25 * 0.01 * sqrt(2.0)) / 1.25, 1e-4);
    }
}

static void tremble(int n, gait_estimate *e)
{
    e->mean.phase = (float)(e->mean.phase + (n % 2 ? 0.03 : 0.97));
    e->mean.phase -= floorf(e->mean.phase);
}

/* A phase that goes to and fro about a strike is one strike. */
static void test_trembling(void)
{
    stride_meter m = {0};
    stride s[MOST];
    int const count = strides(&m, 0, FRAMES, tremble, s);
    CHECK(count == 11);
    for (int k = 0; k < count; k++)
        CHECK_NEAR(s[k].time, 1.25, 0.09);
}

static void lose(int n, gait_estimate *e)
{
    if (n == 60)
        e->status = GAIT_TRACK_LOST;
    if (n == 130)
        e->status = GAIT_TRACK_AMBIGUOUS;
}

static void test_uncertain(void)
{
    stride_meter m = {0};
    stride s[MOST];
    int const count = strides(&m, 0, FRAMES, lose, s);
    CHECK(count == 11);
    for (int k = 0; k < count; k++) {
        double const begin = 1e-6 * (double)(s[k].start_utime - 1000000000), end = begin + 1.25;
        bool const uncertain = (begin < 2.4 && end > 2.4) || (begin < 5.2 && end > 5.2);
        CHECK(s[k].sure == !uncertain);
    }
}

static void swap_legs(int n, gait_estimate *e)
{
    if (n >= 100)
        e->mean.phase = (float)fmod((double)e->mean.phase + 0.5, 1.0);
}

/* After a jump by half a stride, a pause or a new time, strides begin anew: none reaches across. */
static void test_breaks(void)
{
    stride_meter m = {0};
    stride s[MOST];
    int count = strides(&m, 0, FRAMES, swap_legs, s);
    CHECK(count > 4);
    for (int k = 0; k < count; k++) {
        CHECK(s[k].utime < 1000000000 + 4000000 || s[k].start_utime > 1000000000 + 3900000);
        CHECK_NEAR(s[k].time, 1.25, 1e-3);
    }
    m = (stride_meter){0};
    count = strides(&m, 0, 50, NULL, s);
    CHECK(count == 1);
    CHECK(strides(&m, 63, 90, NULL, s) == 0); /* more than half a second missing */
    CHECK(strides(&m, 0, 50, NULL, s) == 1);  /* the walk again from its beginning */
    m.running = false;
    CHECK(strides(&m, 50, 70, NULL, s) == 0);
}

/* One frame in eight is enough. */
static void test_few_frames(void)
{
    stride_meter m = {0};
    stride s;
    int count = 0;
    for (int n = 0; n < FRAMES; n += 8) {
        gait_estimate const e = walk(n);
        if (stride_meter_add(&m, &e, &s)) {
            CHECK_NEAR(s.time, 1.25, 2e-3);
            count++;
        }
    }
    CHECK(count >= 10);
}

int main(void)
{
    test_a_known_walk();
    test_trembling();
    test_uncertain();
    test_breaks();
    test_few_frames();
    return CHECK_DONE();
}
