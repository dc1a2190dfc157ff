#include "init_file.h"

#include "fields.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Numbers of the file beside the pelvis; sd is taken where it gives a value but no standard deviation. */
static const struct {
    const char *key, *remedy;
    size_t offset;
    double low, high, sd;
} scalars[] = {
    {"heading_rad", "give the walking direction about z in radians, 0 = along +x",
     offsetof(gait_state, heading), -7, 7, 0.1},
    {"phase", "give the phase of the stride from 0 (right heel strike) to 1", offsetof(gait_state, phase), 0,
     1, 0.05},
    {"stride_hz", "give strides (two steps) per second, about 0.9", offsetof(gait_state, stride_hz), 0.1, 4,
     0.05},
    {"stature_m", "give the person's height in metres", offsetof(gait_state, stature), 0.5, 2.5, 0.03},
};
/* "sd" may hold the first five. */
static const char *const known[] = {"pelvis",    "heading_rad", "phase", "stride_hz",
                                    "stature_m", "frame",       "sd"};

enum { SCALARS = sizeof scalars / sizeof *scalars, KNOWN = sizeof known / sizeof *known };
static const double PELVIS_SD = 0.05, MAX_SD = 10, FAR = 1e4;

static void put(gait_state *s, size_t offset, double value)
{
    float const narrow = (float)value;
    memcpy((char *)s + offset, &narrow, sizeof narrow);
}

/* `spread`: the object of standard deviations, or -1. */
static bool read_scalar(const fields *f, int spread, int k, init_state *io, message *why)
{
    const char *const key = scalars[k].key;
    double value;
    if (fields_find(f, 0, key) >= 0) {
        if (!fields_numbers(f, 0, key, &value, 1, scalars[k].low, scalars[k].high, scalars[k].remedy, why))
            return false;
        put(&io->mean, scalars[k].offset, value);
        put(&io->sd, scalars[k].offset, scalars[k].sd);
    }
    if (spread >= 0 && fields_find(f, spread, key) >= 0) {
        if (!fields_numbers(f, spread, key, &value, 1, 0, MAX_SD, "give a standard deviation, not negative",
                            why))
            return false;
        put(&io->sd, scalars[k].offset, value);
    }
    return true;
}

/* How many numbers a key holds; 0 if it is absent. */
static int count_of(const fields *f, int object, const char *key)
{
    int const value = object < 0 ? -1 : fields_find(f, object, key);
    return value < 0 ? 0 : json_numbers(&f->doc, value, NULL, 0);
}

/* Two numbers get the model's height over ground, which depends on the rest of the state. */
static bool read_pelvis(const fields *f, int spread, const gait_model *model, init_state *io, message *why)
{
    const char *const place = "give x and y (and z if known) of the pelvis in metres";
    int const known_axes = count_of(f, 0, "pelvis") == 3 ? 3 : 2, sds = count_of(f, spread, "pelvis");
    double value[3];
    if (fields_find(f, 0, "pelvis") >= 0) {
        if (!fields_numbers(f, 0, "pelvis", value, known_axes, -FAR, FAR, place, why))
            return false;
        for (int i = 0; i < 3; i++) {
            io->mean.pelvis[i] = i < known_axes ? (float)value[i] : io->mean.pelvis[i];
            io->sd.pelvis[i] = (float)PELVIS_SD;
        }
    }
    if (known_axes == 2 && gait_model_pelvis_height(model, &io->mean, &io->mean.pelvis[2], NULL) != GAIT_OK)
        return message_set(why, "%s: the model gives no height for the pelvis; give z too", f->path);
    if (sds != 0) {
        if (!fields_numbers(f, spread, "pelvis", value, sds == 3 ? 3 : 1, 0, MAX_SD,
                            "give one number or three, metres", why))
            return false;
        for (int i = 0; i < 3; i++)
            io->sd.pelvis[i] = (float)value[sds == 3 ? i : 0];
    }
    return true;
}

static bool parse(const fields *f, const gait_model *model, init_state *io, message *why)
{
    int const spread = fields_find(f, 0, "sd");
    if (!fields_only(f, 0, known, KNOWN, why))
        return false;
    if (spread >= 0 && f->node[spread].type != JSON_OBJECT)
        return message_set(why, "%s: sd is not an object; give standard deviations by key", f->path);
    if (spread >= 0 && !fields_only(f, spread, known, SCALARS + 1, why))
        return false;
    if (fields_find(f, 0, "frame") >= 0 &&
        !fields_whole(f, "frame", &io->frame, 0, 1u << 31, "give the frame number, from 0", why))
        return false;
    for (int k = 0; k < SCALARS; k++)
        if (!read_scalar(f, spread, k, io, why))
            return false;
    io->mean.phase -= floorf(io->mean.phase);
    return read_pelvis(f, spread, model, io, why);
}

bool init_file_read(const char *path, const gait_model *model, init_state *out, message *why)
{
    fields f;
    init_state state = {.frame = -1};
    if (gait_tracker_prior(model, &state.mean, &state.sd, NULL) != GAIT_OK)
        return message_set(why, "%s: the model has no prior", path);
    bool const ok = fields_open(&f, path, "init", why) && parse(&f, model, &state, why);
    fields_close(&f);
    if (ok)
        *out = state;
    return ok;
}
