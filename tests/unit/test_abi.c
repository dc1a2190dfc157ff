/* The field table against the header: every struct is there and its fields tile it without a hole. */
#include "gait.h"

#include "check.h"

typedef struct want {
    const char *type;
    size_t size;
    int fields;
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
        {"gait_error", sizeof(gait_error), 3},
        {"gait_image", sizeof(gait_image), 5},
        {"gait_camera", sizeof(gait_camera), 9},
        {"gait_state", sizeof(gait_state), 8},
        {"gait_pose", sizeof(gait_pose), 2},
        {"gait_tasks", sizeof(gait_tasks), 2},
        {"gait_model_info", sizeof(gait_model_info), 11},
        {"gait_tracker_config", sizeof(gait_tracker_config), 28},
        {"gait_frame", sizeof(gait_frame), 2},
        {"gait_estimate", sizeof(gait_estimate), 15},
    };
    uint32_t count = 0;
    const gait_abi_field *const table = gait_abi_fields(&count);
    CHECK(gait_abi_fields(NULL) == table);
    uint32_t rows = 0;
    for (size_t s = 0; s < sizeof structs / sizeof *structs; s++) {
        int const first = find(table, count, structs[s].type);
        CHECK(first >= 0 && !table[first].field && table[first].size == structs[s].size);
        uint32_t at = 0, i = (uint32_t)first + 1;
        int fields = 0;
        for (; i < count && table[i].field; i++, fields++) {
            CHECK(strcmp(table[i].type, structs[s].type) == 0 && table[i].offset == at && table[i].size > 0);
            at = table[i].offset + table[i].size;
        }
        CHECK(fields == structs[s].fields);
        CHECK(at == structs[s].size);
        rows += i - (uint32_t)first;
    }
    CHECK(rows == count);
    return CHECK_DONE();
}
