/* The field table against the header: it has every struct, whose fields cover it without gaps. */
#include "gait_start.h"
#include "gait_lift.h"

#include "check.h"

typedef struct want {
    const char *of;
    size_t size;
} want;

#define WANT(T) {#T, sizeof(T)}
static const want STRUCTS[] = {
    WANT(gait_error),        WANT(gait_image),       WANT(gait_camera),     WANT(gait_state),
    WANT(gait_pose),         WANT(gait_model_info),  WANT(gait_tasks),      WANT(gait_tracker_config),
    WANT(gait_keypoint),     WANT(gait_camera_pose), WANT(gait_frame),      WANT(gait_estimate),
    WANT(gait_lift_info),    WANT(gait_lift_config), WANT(gait_lift_fit),   WANT(gait_lift_frame),
    WANT(gait_start_config), WANT(gait_box),         WANT(gait_hypothesis),
};
enum { COUNT = sizeof STRUCTS / sizeof *STRUCTS };

static void test_tiling(void)
{
    gait_field f;
    size_t end = 0, known = 0;
    uint32_t rows = 0;
    for (; gait_field_at(rows, &f) == GAIT_OK; rows++) {
        CHECK(f.of && f.name && f.type && f.array && f.unit && f.text && f.size > 0);
        if (!*f.name) { /* the struct itself */
            CHECK(known < COUNT && (known == 0 || end == STRUCTS[known - 1].size));
            CHECK(strcmp(f.of, STRUCTS[known].of) == 0 && f.size == STRUCTS[known].size);
            known++;
            end = 0;
            continue;
        }
        CHECK(strcmp(f.of, STRUCTS[known - 1].of) == 0 && f.offset == end && *f.type);
        CHECK(strlen(f.text) > 3 && f.text[strlen(f.text) - 1] == '.');
        end += f.size;
    }
    CHECK(known == COUNT && end == STRUCTS[COUNT - 1].size && rows > 150);
    CHECK(gait_field_at(rows, &f) == GAIT_ERR_ARG && gait_field_at(0, NULL) == GAIT_ERR_ARG);
}

static gait_field find(const char *of, const char *name)
{
    gait_field f = {0};
    for (uint32_t i = 0; gait_field_at(i, &f) == GAIT_OK; i++)
        if (strcmp(f.of, of) == 0 && strcmp(f.name, name) == 0)
            return f;
    check_that(0, "there is such a field", __FILE__, __LINE__);
    return f;
}

static void test_rows(void)
{
    gait_field f = find("gait_estimate", "joint_sd");
    CHECK(f.offset == offsetof(gait_estimate, joint_sd) && f.size == sizeof(float[GAIT_MAX_JOINTS][3]));
    CHECK(strcmp(f.type, "float") == 0 && strcmp(f.array, "[32][3]") == 0 && strcmp(f.unit, "metres") == 0);
    CHECK(isnan(f.low) && isnan(f.high));
    f = find("gait_tracker_config", "rejuvenation_time");
    CHECK(f.offset == offsetof(gait_tracker_config, rejuvenation_time) && f.low == 0.0 && f.high == 1e6);
    CHECK(strncmp(f.text, "Time constant", 13) == 0);
    f = find("gait_frame", "keypoints");
    CHECK(f.offset == offsetof(gait_frame, keypoints) && strcmp(f.type, "const gait_keypoint *") == 0);
}

int main(void)
{
    test_tiling();
    test_rows();
    return CHECK_DONE();
}
