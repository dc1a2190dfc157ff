#include "image/camera.h"

#include "check.h"

/* Camera at (0, -5, 1.5) looking along +y: x right, y down, z forward. */
static gait_camera toward_origin(void)
{
    return (gait_camera){.width = 640,
                         .height = 480,
                         .fx = 500.0f,
                         .fy = 520.0f,
                         .cx = 319.5f,
                         .cy = 239.5f,
                         .R = {1, 0, 0, 0, 0, -1, 0, 1, 0},
                         .t = {0, 1.5f, 5}};
}

static void test_project(void)
{
    gait_camera const c = toward_origin();
    float uv[2] = {-1.0f, -2.0f};
    CHECK(camera_project(&c, (float[3]){0, 0, 1.5f}, uv) == 5.0f);
    CHECK(uv[0] == 319.5f && uv[1] == 239.5f);
    CHECK(camera_project(&c, (float[3]){1, 0, 2.0f}, uv) == 5.0f);
    CHECK_NEAR(uv[0], 319.5 + 100.0, 1e-4);
    CHECK_NEAR(uv[1], 239.5 - 52.0, 1e-4);
    uv[0] = -1.0f;
    CHECK(camera_project(&c, (float[3]){0, -6, 1}, uv) == -1.0f && uv[0] == -1.0f);
    CHECK(camera_project(&c, (float[3]){0, -4.96f, 1}, uv) < CAMERA_NEAR && uv[0] == -1.0f);
}

static void test_valid(void)
{
    gait_camera c = toward_origin();
    CHECK(camera_valid(&c));
    c.R[0] = -1.0f; /* mirror */
    CHECK(!camera_valid(&c));
    c = toward_origin();
    c.R[4] = 0.01f; /* skew */
    CHECK(!camera_valid(&c));
    c = toward_origin();
    c.R[0] = 1.0004f; /* rounding of a text file */
    CHECK(camera_valid(&c));
    float *const number[] = {&c.fx, &c.fy, &c.cx, &c.cy, &c.R[3], &c.t[2], &c.distortion[4]};
    for (size_t i = 0; i < sizeof number / sizeof *number; i++) {
        float const kept = *number[i];
        *number[i] = nanf("");
        CHECK(!camera_valid(&c));
        *number[i] = HUGE_VALF;
        CHECK(!camera_valid(&c));
        *number[i] = kept;
    }
    static const float ends[][2] = {{1e-3f, 1e9f}, {1e-3f, 1e9f}, {-1e6f, 1e6f}, {-1e6f, 1e6f},
                                    {0.0f, 0.0f},  {-1e4f, 1e4f}, {-1e3f, 1e3f}};
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++)
        for (int high = 0; high < 2; high++) {
            float const kept = *number[i], at = ends[i][high];
            *number[i] = at;
            CHECK(camera_valid(&c));
            *number[i] = high ? at + 0.01f * fabsf(at) + 0.01f : at - 0.01f * fabsf(at) - 0.01f;
            CHECK(!camera_valid(&c));
            *number[i] = kept;
        }
    c = toward_origin();
    c.width = -1;
    CHECK(!camera_valid(&c));
    c = toward_origin();
    c.height = 0;
    CHECK(!camera_valid(&c));
}

/* Values from OpenCV's projectPoints, which computes in double. */
static void test_distort(void)
{
    gait_camera c = toward_origin();
    float u, v;
    CHECK(!camera_distorted(&c));
    camera_distort(&c, 100.0f, 50.0f, &u, &v);
    CHECK_NEAR(u, 100.0, 1e-4);
    CHECK_NEAR(v, 50.0, 1e-4);
    static const float d[5] = {-0.28f, 0.09f, 0.001f, -0.0005f, -0.012f};
    memcpy(c.distortion, d, sizeof d);
    CHECK(camera_distorted(&c));
    camera_distort(&c, 319.5f, 239.5f, &u, &v);
    CHECK(u == 319.5f && v == 239.5f);
    camera_distort(&c, 100.0f, 50.0f, &u, &v);
    CHECK_NEAR(u, 117.98650575, 1e-4);
    CHECK_NEAR(v, 65.76774507, 1e-4);
}

/* In millimetres; at the origin with z ahead; y up, and -z up. */
static void test_place(void)
{
    static const float TURNED[3][9] = {
        {1, 0, 0, 0, 1, 0, 0, 0, 1}, {1, 0, 0, 0, -1, 0, 0, 0, -1}, {-1, 0, 0, 0, 0, 1, 0, 1, 0}};
    static const char *const UP[3] = {"-y up", "+y up", "-z up"};
    gait_camera c = toward_origin();
    gait_error err;
    CHECK(gait_camera_check(&c, NULL) == GAIT_OK);
    c.t[1] = 1500.0f;
    CHECK(gait_camera_check(&c, &err) == GAIT_ERR_ARG && strstr(err.text, "1500 m above the floor, +z up"));
    for (int i = 0; i < 3; i++) {
        c = toward_origin();
        memcpy(c.R, TURNED[i], sizeof c.R);
        if (i == 0)
            memset(c.t, 0, sizeof c.t);
        CHECK(gait_camera_check(&c, &err) == GAIT_ERR_ARG && strstr(err.text, UP[i]));
        CHECK(strstr(err.text, "give R and t in metres, z up, floor z = 0"));
    }
    c.R[0] = NAN;
    CHECK(gait_camera_check(&c, NULL) == GAIT_ERR_ARG && gait_camera_check(NULL, NULL) == GAIT_ERR_ARG);
}

int main(void)
{
    test_project();
    test_valid();
    test_place();
    test_distort();
    return CHECK_DONE();
}
