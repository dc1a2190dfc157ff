/* The field table against the header: every struct is there and its fields tile it without a hole. */
#include "gait_lift.h"

#include "check.h"

typedef struct want {
    const char *type;
    size_t size;
} want;

static int find(const gait_abi_field *table, uint32_t count, const char *type)
{
    for (uint32_t i = 0; i < count; i++)
        if (strcmp(table[i].type, type) == 0)
            return (int)i;
    return -1;
}

int main(void)
{
    static const want structs[] = {
        {"gait_error", sizeof(gait_error)},
        {"gait_image", sizeof(gait_image)},
        {"gait_camera", sizeof(gait_camera)},
        {"gait_state", sizeof(gait_state)},
        {"gait_pose", sizeof(gait_pose)},
        {"gait_tasks", sizeof(gait_tasks)},
        {"gait_model_info", sizeof(gait_model_info)},
        {"gait_tracker_config", sizeof(gait_tracker_config)},
        {"gait_keypoint", sizeof(gait_keypoint)},
        {"gait_frame", sizeof(gait_frame)},
        {"gait_estimate", sizeof(gait_estimate)},
        {"gait_lift_info", sizeof(gait_lift_info)},
        {"gait_lift_config", sizeof(gait_lift_config)},
        {"gait_lift_fit", sizeof(gait_lift_fit)},
        {"gait_lift_frame", sizeof(gait_lift_frame)},
    };
    uint32_t count = 0;
    const gait_abi_field *const table = gait_abi_fields(&count);
    CHECK(gait_abi_fields(NULL) == table);
    uint32_t rows = 0;
    for (uint32_t i = 0; i < count; i++)
        CHECK(memchr(table[i].type, 0, sizeof table[i].type) &&
              memchr(table[i].field, 0, sizeof table[i].field));
    for (size_t s = 0; s < sizeof structs / sizeof *structs; s++) {
        int const first = find(table, count, structs[s].type);
        CHECK(first >= 0 && !table[first].field[0] && table[first].size == structs[s].size);
        uint32_t at = 0, i = (uint32_t)first + 1;
        for (; i < count && table[i].field[0]; i++) {
            CHECK(strcmp(table[i].type, structs[s].type) == 0 && table[i].offset == at && table[i].size > 0);
            at = table[i].offset + table[i].size;
        }
        CHECK(at == structs[s].size);
        rows += i - (uint32_t)first;
    }
    CHECK(rows == count);
    return CHECK_DONE();
}
