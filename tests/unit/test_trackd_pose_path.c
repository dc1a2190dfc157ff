/* Where a moving camera is at the time of a frame: between poses, in gaps and jumps, and when the clock was set back. */
#include "../../tools/trackd/pose_path.h"

#include "check.h"

enum { FRAME = 40000 }; /* microseconds */

static pose_path path;
static message why;
static gait_camera_pose pose;

static void begin(void)
{
    path = (pose_path){.turn_sd = 0.25f, .place_sd = 0.5f};
    why.text[0] = '\0';
}

/* A camera at x, turned by this angle about its own down axis. */
static bool at(int64_t utime, double x, double angle)
{
    float const c = (float)cos(angle), s = (float)sin(angle);
    gait_camera const camera = {.R = {c, -s, 0, s, c, 0, 0, 0, 1}, .t = {-c * (float)x, -s * (float)x, 0}};
    return pose_path_add(&path, utime, &camera, &why);
}

/* Place of the lens of `pose`, along x. */
static double place(void)
{
    return -(double)(pose.R[0] * pose.t[0] + pose.R[3] * pose.t[1] + pose.R[6] * pose.t[2]);
}

static void test_between(void)
{
    begin();
    CHECK(at(1000, 1, 0) && at(1000 + FRAME, 1.2, 0.1));
    CHECK(pose_path_at(&path, 1000 + FRAME / 4, &pose, &why) == POSE_KNOWN);
    CHECK_NEAR(place(), 1.05, 1e-5);
    CHECK_NEAR(atan2((double)pose.R[3], (double)pose.R[0]), 0.025, 1e-6);
    CHECK_NEAR(pose.turn_sd, 0.25, 0);
    CHECK_NEAR(pose.place_sd, 0.5, 0);
    CHECK(pose_path_at(&path, 1000 + FRAME, &pose, &why) == POSE_KNOWN);
    CHECK_NEAR(place(), 1.2, 1e-6);
    CHECK(at(1000 + 2 * FRAME, 1.4, 0.1)); /* moves without turning */
    CHECK(pose_path_at(&path, 1000 + 3 * FRAME / 2, &pose, &why) == POSE_KNOWN);
    CHECK_NEAR(place(), 1.3, 1e-5);
    CHECK_NEAR(atan2((double)pose.R[3], (double)pose.R[0]), 0.1, 1e-6);
}

/* A camera that stands still has exactly the pose that was announced. */
static void test_still(void)
{
    begin();
    CHECK(at(0, 0.1, 0.3) && at(FRAME, 0.1, 0.3));
    CHECK(pose_path_at(&path, FRAME / 3, &pose, &why) == POSE_KNOWN);
    CHECK(memcmp(&pose, &path.pose[0].sent, sizeof pose) == 0);
}

static void test_gaps(void)
{
    begin();
    CHECK(at(0, 0, 0) && at(POSE_PATH_GAP + 1, 0, 0) && at(POSE_PATH_GAP + 1 + FRAME, 1, 0));
    CHECK(pose_path_at(&path, FRAME, &pose, &why) == POSE_UNKNOWN && strstr(why.text, "for 0.50 s"));
    CHECK(pose_path_at(&path, POSE_PATH_GAP + 2, &pose, &why) == POSE_UNKNOWN);
    CHECK(strstr(why.text, "jumped by 1.00 m and 0 degrees") != NULL);
    CHECK(at(POSE_PATH_GAP + 1 + 2 * FRAME, 1, 1));
    CHECK(pose_path_at(&path, POSE_PATH_GAP + 2 + FRAME, &pose, &why) == POSE_UNKNOWN);
    CHECK(strstr(why.text, "jumped by 0.00 m and 57 degrees") != NULL);
}

static void test_order(void)
{
    begin();
    CHECK(!at(-1, 0, 0) && strstr(why.text, "out of range"));
    CHECK(!at(INT64_MAX / 2 + 1, 0, 0) && path.count == 0);
    CHECK(at(3000000, 0, 0) && at(3000000 + FRAME, 0.1, 0));
    CHECK(at(3000000 + FRAME, 5, 0) && path.count == 2 &&
          path.refused == 0); /* repeated: the first one stays */
    CHECK(!at(3000000, 0, 0) && strstr(why.text, "out of order") && path.refused == 1 && path.count == 2);
    CHECK(at(3000000 + FRAME - POSE_PATH_SET_BACK, 7, 0) && path.count == 1); /* the clock was set back */
    CHECK(pose_path_at(&path, 3000000 + FRAME - POSE_PATH_SET_BACK, &pose, &why) == POSE_KNOWN);
    CHECK_NEAR(place(), 7, 1e-6);
}

/* Poses are forgotten after 256; a frame before the oldest has none. */
static void test_oldest(void)
{
    begin();
    CHECK(pose_path_at(&path, 0, &pose, &why) == POSE_LATER);
    for (int i = 0; i < POSE_PATH_KEPT + 10; i++)
        CHECK(at((int64_t)i * FRAME, 0.01 * i, 0));
    CHECK(pose_path_at(&path, (int64_t)10 * FRAME, &pose, &why) == POSE_KNOWN);
    CHECK_NEAR(place(), 0.1, 1e-6);
    CHECK(pose_path_at(&path, (int64_t)10 * FRAME - 1, &pose, &why) == POSE_UNKNOWN);
    CHECK(strstr(why.text, "older than the first camera pose") != NULL);
}

static void test_now(void)
{
    begin();
    CHECK(!pose_path_now(&path, 0, &pose, &why) && path.unknown == 1 && strstr(why.text, "no camera pose"));
    CHECK(at(FRAME, 2, 0));
    CHECK(pose_path_now(&path, FRAME, &pose, &why) && path.unknown == 1);
    CHECK(pose_path_now(&path, FRAME + POSE_PATH_LATE, &pose, &why));
    CHECK_NEAR(place(), 2, 1e-6);
    CHECK(!pose_path_now(&path, FRAME + POSE_PATH_LATE + 1, &pose, &why) && path.unknown == 2);
    CHECK(!pose_path_now(&path, FRAME - 1, &pose, &why) && path.unknown == 3);
    CHECK(strstr(why.text, "older than the first") != NULL);
}

int main(void)
{
    test_between();
    test_still();
    test_gaps();
    test_order();
    test_oldest();
    test_now();
    return CHECK_DONE();
}
