#include "base/base.h"

#include "check.h"

static void test_min_max(void)
{
    float const nan = nanf("");
    CHECK(f_min(1.0f, 2.0f) == 1.0f && f_max(1.0f, 2.0f) == 2.0f);
    CHECK(f_min(nan, 2.0f) == 2.0f && f_max(nan, 2.0f) == 2.0f);
    CHECK(f_clamp(5.0f, -1.0f, 1.0f) == 1.0f && f_clamp(-5.0f, -1.0f, 1.0f) == -1.0f);
    CHECK(f_clamp(0.5f, -1.0f, 1.0f) == 0.5f && f_clamp(nan, -1.0f, 1.0f) == -1.0f);
    CHECK(i_min(-3, 2) == -3 && i_max(-3, 2) == 2);
    CHECK(i_clamp(9, 0, 4) == 4 && i_clamp(-9, 0, 4) == 0 && i_clamp(3, 0, 4) == 3);
}

static void test_finite(void)
{
    float x[3] = {1.0f, -FLT_MAX, 0.0f};
    CHECK(f_finite(x, 3) && f_finite(x, 0));
    x[2] = nanf("");
    CHECK(!f_finite(x, 3) && f_finite(x, 2));
    x[2] = -HUGE_VALF;
    CHECK(!f_finite(x, 3));
}

static void test_fail(void)
{
    gait_error err = {.result = 7};
    CHECK(base_fail(NULL, GAIT_ERR_ARG, 3, "unseen") == GAIT_ERR_ARG);
    CHECK(base_fail(&err, GAIT_ERR_LIMIT, 2, "camera %d: %s", 2, "too wide") == GAIT_ERR_LIMIT);
    CHECK(err.result == GAIT_ERR_LIMIT && err.index == 2 && strcmp(err.text, "camera 2: too wide") == 0);
    base_fail(&err, GAIT_ERR_ARG, -1, "%0200d", 1);
    CHECK(strlen(err.text) == sizeof err.text - 1);
}

int main(void)
{
    test_min_max();
    test_finite();
    test_fail();
    return CHECK_DONE();
}
