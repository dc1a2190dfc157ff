#include "api/fields.h"

#include "gait_lift.h"
#include "gait_start.h"

#include <string.h>

/* Every public struct with its table.  The rows are passed to F, R, S and P by their kind; see gait.h. */
#define STRUCTS(OF, F, R, S, P)                                                                              \
    OF(gait_error, GAIT_ERROR_FIELDS(F))                                                                     \
    OF(gait_image, GAIT_IMAGE_FIELDS(F))                                                                     \
    OF(gait_camera, GAIT_CAMERA_FIELDS(F))                                                                   \
    OF(gait_state, GAIT_STATE_FIELDS(R))                                                                     \
    OF(gait_pose, GAIT_POSE_FIELDS(F))                                                                       \
    OF(gait_model_info, GAIT_MODEL_INFO_FIELDS(F))                                                           \
    OF(gait_tasks, GAIT_TASKS_FIELDS(F))                                                                     \
    OF(gait_tracker_config, GAIT_TRACKER_CONFIG_FIELDS(S, P, F))                                             \
    OF(gait_keypoint, GAIT_KEYPOINT_FIELDS(F))                                                               \
    OF(gait_camera_pose, GAIT_CAMERA_POSE_FIELDS(R))                                                         \
    OF(gait_frame, GAIT_FRAME_FIELDS(F))                                                                     \
    OF(gait_estimate, GAIT_ESTIMATE_FIELDS(F))                                                               \
    OF(gait_lift_info, GAIT_LIFT_INFO_FIELDS(F))                                                             \
    OF(gait_lift_config, GAIT_LIFT_CONFIG_FIELDS(S, F))                                                      \
    OF(gait_lift_fit, GAIT_LIFT_FIT_FIELDS(F))                                                               \
    OF(gait_lift_frame, GAIT_LIFT_FRAME_FIELDS(F))                                                           \
    OF(gait_start_config, GAIT_START_CONFIG_FIELDS(S, F))                                                    \
    OF(gait_box, GAIT_BOX_FIELDS(F))                                                                         \
    OF(gait_hypothesis, GAIT_HYPOTHESIS_FIELDS(F))

/* Fields follow one another without padding, so their sizes give their offsets. */
#define ADD_SIZE(meaning, type, name, array, ...) +sizeof(type array)
#define HAS_NO_PADDING(T, ...) _Static_assert(0 __VA_ARGS__ == sizeof(T), #T " has padding");
STRUCTS(HAS_NO_PADDING, ADD_SIZE, ADD_SIZE, ADD_SIZE, ADD_SIZE)

enum row_kind { ROW_STRUCT, ROW_FREE, ROW_LIMITED };

typedef struct row {
    uint16_t size;
    uint8_t kind; /* ROW_LIMITED: its range is the next of LIMITS */
} row;

typedef struct limit {
    double low, high;
} limit;

#define FREE(meaning, type, name, array, ...)    {sizeof(type array), ROW_FREE},
#define LIMITED(meaning, type, name, array, ...) {sizeof(type array), ROW_LIMITED},
#define ROWS_OF(T, ...)                          {sizeof(T), ROW_STRUCT}, __VA_ARGS__
static const row FIELD_ROWS[] = {STRUCTS(ROWS_OF, FREE, LIMITED, LIMITED, LIMITED)};
enum { ROW_COUNT = sizeof FIELD_ROWS / sizeof *FIELD_ROWS };

#define NO_LIMIT(...)
#define LIMIT(meaning, type, name, array, unit, low, high)                     {low, high},
#define LIMIT_SETTING(meaning, type, name, array, unit, usual, low, high)      {low, high},
#define LIMIT_PAPER(meaning, type, name, array, unit, usual, paper, low, high) {low, high},
#define LIMITS_OF(T, ...)                                                      __VA_ARGS__
static const limit LIMITS[] = {STRUCTS(LIMITS_OF, NO_LIMIT, LIMIT, LIMIT_SETTING, LIMIT_PAPER)};

/* Name, type, array, unit and meaning of all rows in one string, each followed by a NUL.  Without pointers to them the
 * library needs no relocations. */
#define STRING(x)                               #x
#define WORDS(name, type, array, unit, meaning) name "\0" type "\0" array "\0" unit "\0" meaning
#define MEMBER(meaning, type, name, array, ...) MEMBER_OF_5(meaning, type, name, array, __VA_ARGS__, )
#define MEMBER_OF_5(meaning, type, name, array, unit, ...)                                                   \
    char name[sizeof WORDS(#name, #type, STRING(array), unit, meaning)];
#define INIT(meaning, type, name, array, ...)            INIT_OF_5(meaning, type, name, array, __VA_ARGS__, )
#define INIT_OF_5(meaning, type, name, array, unit, ...) WORDS(#name, #type, STRING(array), unit, meaning),
#define MEMBERS_OF(T, ...)                                                                                   \
    struct {                                                                                                 \
        char itself[sizeof WORDS(#T, "", "", "", "")];                                                       \
        __VA_ARGS__                                                                                          \
    } T;
#define INIT_OF(T, ...) {WORDS(#T, "", "", "", ""), __VA_ARGS__},

static const struct {
    STRUCTS(MEMBERS_OF, MEMBER, MEMBER, MEMBER, MEMBER)
} TEXT = {STRUCTS(INIT_OF, INIT, INIT, INIT, INIT)};

/* Walks through the rows in order. */
typedef struct cursor {
    uint32_t index;
    const limit *limit;
    const char *text;
    gait_field field;
} cursor;

static const char *next_text(cursor *c)
{
    const char *const text = c->text;
    c->text += strlen(text) + 1;
    return text;
}

static bool next_field(cursor *c)
{
    gait_field *const f = &c->field;
    if (c->index >= ROW_COUNT)
        return false;
    const row *const r = &FIELD_ROWS[c->index++];
    const char *const name = next_text(c);
    if (r->kind == ROW_STRUCT)
        *f = (gait_field){.of = name, .name = ""};
    else {
        f->offset += *f->name ? f->size : 0;
        f->name = name;
    }
    f->type = next_text(c);
    f->array = next_text(c);
    f->unit = next_text(c);
    f->text = next_text(c);
    f->size = r->size;
    limit const l = r->kind == ROW_LIMITED ? *c->limit++ : (limit){NAN, NAN};
    f->low = l.low;
    f->high = l.high;
    return true;
}

static cursor first_field(void)
{
    return (cursor){.limit = LIMITS, .text = (const char *)&TEXT};
}

/* The next field of a struct; c begins with first_field(). */
static bool next_field_of(cursor *c, const char *of)
{
    while (next_field(c))
        if (*c->field.name && strcmp(c->field.of, of) == 0)
            return true;
    return false;
}

gait_result gait_field_at(uint32_t index, gait_field *out)
{
    cursor c = first_field();
    if (!out || index >= ROW_COUNT)
        return GAIT_ERR_ARG;
    while (c.index <= index)
        (void)next_field(&c);
    *out = c.field;
    return GAIT_OK;
}

/* Number i of a field. */
static double number(const gait_field *f, const void *values, size_t i)
{
    const char *const at = (const char *)values + f->offset;
    float single;
    double real;
    int32_t whole;
    int64_t integer;
    switch (f->type[0]) {
    case 'f':
        memcpy(&single, at + i * sizeof single, sizeof single);
        return (double)single;
    case 'd':
        memcpy(&real, at + i * sizeof real, sizeof real);
        return real;
    default:
        if (strcmp(f->type, "int64_t") == 0) {
            memcpy(&integer, at + i * sizeof integer, sizeof integer);
            return (double)integer;
        }
        memcpy(&whole, at + i * sizeof whole, sizeof whole);
        return whole;
    }
}

static gait_result check_field(const gait_field *f, const void *values, double low, double high,
                               const char *what, gait_error *err)
{
    bool const single = f->type[0] == 'f', real = single || f->type[0] == 'd';
    size_t const each = single || strcmp(f->type, "int32_t") == 0 ? 4 : 8;
    for (size_t i = 0; i < f->size / each; i++) {
        double const v = number(f, values, i);
        if (v >= low && v <= high) /* false for NaN */
            continue;
        return base_fail(err, real ? GAIT_ERR_ARG : GAIT_ERR_LIMIT, -1,
                         real ? "%s%s = %g is outside [%g, %g]" : "%s%s = %.0f is outside [%.0f, %.0f]", what,
                         f->name, v, low, high);
    }
    return GAIT_OK;
}

gait_result fields_check(const char *of, const void *values, const char *what, gait_error *err)
{
    gait_result s = GAIT_OK;
    for (cursor c = first_field(); s == GAIT_OK && next_field_of(&c, of);)
        if (!isnan(c.field.low))
            s = check_field(&c.field, values, c.field.low, c.field.high, what, err);
    return s;
}

gait_result fields_check_sd(const char *of, const void *values, double most, const char *what,
                            gait_error *err)
{
    gait_result s = GAIT_OK;
    for (cursor c = first_field(); s == GAIT_OK && next_field_of(&c, of);)
        s = check_field(&c.field, values, 0.0, most, what, err);
    return s;
}

gait_result fields_check_size(const char *of, uint64_t struct_size, const char *filled_by, gait_error *err)
{
    enum { LEAST_BYTES = 16 }; /* bytes: size, and mode or projection */
    uint64_t end = 0;
    for (cursor c = first_field(); end != struct_size && next_field_of(&c, of);)
        end = c.field.offset + c.field.size;
    if (end == struct_size && end >= LEAST_BYTES)
        return GAIT_OK;
    if (struct_size > end)
        return base_fail(err, GAIT_ERR_STRUCT, -1,
                         "%s has %llu bytes but this library knows only %llu: build with its headers", of,
                         (unsigned long long)struct_size, (unsigned long long)end);
    return base_fail(err, GAIT_ERR_STRUCT, -1, "%s was not filled by %s()", of, filled_by);
}
