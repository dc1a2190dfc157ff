#include "init_file.h"

#include "fields.h"

#include <math.h>
#include <stddef.h>

/* What the file may say; sd is taken where it gives a value but no standard deviation. */
static const struct {
    const char *key, *remedy;
    size_t offset;
    int count;
    double low, high, sd;
} quantities[] = {
    {"pelvis", "give [x, y, z] in metres", offsetof(gait_state, pelvis), 3, -1e5, 1e5, 0.05},
    {"heading_rad", "give radians, 0 along +x", offsetof(gait_state, heading), 1, -1e3, 1e3, 0.1},
    {"phase", "give strides, 0 at right heel strike", offsetof(gait_state, phase), 1, -1e3, 1e3, 0.05},
    {"stride_hz", "give strides per second", offsetof(gait_state, stride_hz), 1, 0.05, 10, 0.05},
    {"stature_m", "give metres", offsetof(gait_state, stature), 1, 0.3, 3, 0.03},
};
static const char *const known[] = {"pelvis",    "heading_rad", "phase", "stride_hz",
                                    "stature_m", "frame",       "sd"};

enum { QUANTITIES = sizeof quantities / sizeof *quantities, KNOWN = sizeof known / sizeof *known };

/* One or `count` standard deviations of quantity q; `deviation` is the object of them, or -1. */
static bool read_sd(const fields *f, int deviation, int q, double out[3], message *why)
{
    const char *const remedy = "give one standard deviation, or one for each number";
    int const count = quantities[q].count;
    int const value = deviation < 0 ? -1 : fields_find(f, deviation, quantities[q].key);
    int const found = value < 0 ? 0 : json_numbers(&f->doc, value, NULL, 0);
    out[0] = quantities[q].sd;
    if (value >= 0 && !fields_numbers(f, deviation, quantities[q].key, out, found == count ? count : 1, 0,
                                      1e5, remedy, why))
        return false;
    for (int i = 1; i < count && found != count; i++)
        out[i] = out[0];
    return true;
}

static bool read_quantity(const fields *f, int deviation, int q, init_state *io, message *why)
{
    double mean[3], sd[3];
    float *to_mean = (float *)(void *)((char *)&io->mean + quantities[q].offset);
    float *to_sd = (float *)(void *)((char *)&io->sd + quantities[q].offset);
    const char *key = quantities[q].key;
    if (fields_find(f, 0, key) < 0) {
        if (deviation >= 0 && fields_find(f, deviation, key) >= 0)
            return message_set(why, "%s: sd has %s but there is no %s; give both or neither", f->path, key,
                               key);
        return true;
    }
    if (!fields_numbers(f, 0, key, mean, quantities[q].count, quantities[q].low, quantities[q].high,
                        quantities[q].remedy, why) ||
        !read_sd(f, deviation, q, sd, why))
        return false;
    if (quantities[q].offset == offsetof(gait_state, phase))
        mean[0] -= floor(mean[0]);
    for (int i = 0; i < quantities[q].count; i++) {
        to_mean[i] = (float)mean[i];
        to_sd[i] = (float)sd[i];
    }
    return true;
}

static bool parse(const fields *f, init_state *io, message *why)
{
    int const deviation = fields_find(f, 0, "sd");
    double frame = -1;
    if (!fields_only(f, 0, known, KNOWN, why))
        return false;
    if (deviation >= 0 && f->node[deviation].type != JSON_OBJECT)
        return message_set(why, "%s: sd is not an object; give the standard deviations by name", f->path);
    if (deviation >= 0 && !fields_only(f, deviation, known, QUANTITIES, why))
        return false;
    for (int q = 0; q < QUANTITIES; q++)
        if (!read_quantity(f, deviation, q, io, why))
            return false;
    if (fields_find(f, 0, "frame") >= 0 &&
        !fields_numbers(f, 0, "frame", &frame, 1, 0, 1e12, "give the number of a frame, from 0", why))
        return false;
    io->frame = (int64_t)frame;
    return true;
}

bool init_file_read(const char *path, init_state *io, message *why)
{
    fields f;
    init_state state = *io;
    bool const ok = fields_open(&f, path, "init", why) && parse(&f, &state, why);
    fields_close(&f);
    if (ok)
        *io = state;
    return ok;
}
