/* The lifter stays within the memory that it asks for: canaries on both sides, and any previous contents. */
#include "gait.h"

#include <stdbool.h>

#include "base/hash.h"
#include "sanitized.h"
#include "toy_passer.h"

enum { CANARY = 4 * GAIT_ALIGN, PUSHES = 1000 };

static _Alignas(GAIT_ALIGN) unsigned char outside[2 * CANARY + TOY_LIFT_BYTES];

static size_t bytes_of(const gait_lift_config *c)
{
    size_t bytes = 0;
    CHECK(gait_lift_bytes(toy_lift_model, c, &bytes, NULL) == GAIT_OK);
    return bytes;
}

static bool intact(const unsigned char *p, size_t bytes, unsigned char fill)
{
    for (size_t i = 0; i < bytes; i++)
        if (p[i] != fill)
            return false;
    return true;
}

/* Hash of the estimates of a stream and of the segments around it, in exactly the bytes asked for. */
static uint64_t run(const gait_lift_config *c, unsigned char fill)
{
    size_t const need = bytes_of(c);
    gait_lift *l = NULL;
    gait_lift_frame f;
    CHECK(need <= TOY_LIFT_BYTES);
    TAKE_BACK(outside, sizeof outside);
    memset(outside, fill, sizeof outside);
    CHECK(gait_lift_init(outside + CANARY, need, toy_lift_model, c, &l, NULL) == GAIT_OK);
    CHECK(passer_segment(l, c));
    CHECK(passer_stream(l, c, PUSHES));
    CHECK(gait_lift_estimate(l, &f, NULL) == GAIT_OK);
    uint64_t const h = hash_fnv1a(HASH_INIT, &f, sizeof f);
    CHECK(passer_segment(l, c));
    gait_lift_reset(l);
    CHECK(passer_stream(l, c, PUSHES / 4));
    CHECK(intact(outside, CANARY, fill));
    CHECK(intact(outside + CANARY + need, sizeof outside - CANARY - need, fill));
    return h;
}

static void test_canaries(int projection, int components)
{
    toy_lift_learn(components, 0);
    gait_lift_config c = toy_lift_config(projection);
    c.sd = 1.0;
    c.lag = 7;
    c.stature_sd = -1.0; /* every unknown there is */
    CHECK(run(&c, 0x5a) == run(&c, 0xff));
}

/* Many segments at once, pixels by the metre. */
static void test_canaries_of_a_batch(void)
{
    enum { COUNT = 5 };
    static double uv[COUNT * TOY_SEGMENT * 2], sd[TOY_SEGMENT], mean[COUNT * TOY_SEGMENT * 3];
    toy_lift_learn(1, 0);
    gait_lift_config c = toy_lift_config(GAIT_LIFT_ORTHOGRAPHIC);
    c.heading_sd = 0.0;
    c.lag = -1;
    size_t const need = bytes_of(&c);
    gait_lift *l = NULL;
    TAKE_BACK(outside, sizeof outside);
    memset(outside, 0x5a, sizeof outside);
    CHECK(gait_lift_init(outside + CANARY, need, toy_lift_model, &c, &l, NULL) == GAIT_OK);
    for (int i = 0; i < TOY_SEGMENT; i++)
        sd[i] = i % 5 ? 0.01 : INFINITY;
    CHECK(gait_lift_fix(l, sd, NULL) == GAIT_OK && gait_lift_batch(l, COUNT, uv, mean, NULL) == GAIT_OK);
    CHECK(intact(outside, CANARY, 0x5a) &&
          intact(outside + CANARY + need, sizeof outside - CANARY - need, 0x5a));
}

/* One byte less is refused; the size grows only with what is asked for. */
static void test_sizes(void)
{
    toy_lift_learn(1, 0);
    gait_lift_config c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    size_t const base = bytes_of(&c);
    gait_lift *l = NULL;
    gait_error err = {0};
    CHECK(base % GAIT_ALIGN == 0);
    CHECK(gait_lift_init(outside, base - 1, toy_lift_model, &c, &l, &err) != GAIT_OK);
    CHECK(l == NULL && strlen(err.text) > 0);
    c.max_rate *= 2.0;
    CHECK(bytes_of(&c) > base);
    c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.lag = -1;
    CHECK(bytes_of(&c) < base);
    c = toy_lift_config(GAIT_LIFT_PERSPECTIVE);
    c.sd = 9.0;
    CHECK(bytes_of(&c) == base);
}

int main(void)
{
    test_canaries(GAIT_LIFT_PERSPECTIVE, 1);
    test_canaries(GAIT_LIFT_PERSPECTIVE, 2);
    test_canaries_of_a_batch();
    test_sizes();
    return CHECK_DONE();
}
