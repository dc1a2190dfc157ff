#include "input_files.h"

#include "json.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* ---- images ---- */
/* Next number of the header; space and comments before it are skipped.  -1: none. */
static int32_t header_number(const unsigned char **at)
{
    const unsigned char *s = *at;
    int32_t value = 0;
    while (*s == ' ' || *s == '\t' || *s == '\r' || *s == '\n' || *s == '#') {
        if (*s == '#')
            while (s[1] && s[1] != '\n')
                s++;
        s++;
    }
    if (*s < '0' || *s > '9')
        return -1;
    for (; *s >= '0' && *s <= '9'; s++)
        value = value > GAIT_MAX_PIXELS ? value : value * 10 + (*s - '0');
    *at = s;
    return value;
}

static bool parse_pnm(const char *path, const file_bytes *bytes, gait_image *out, message *why)
{
    const unsigned char *at = bytes->data + 2;
    if (bytes->data[0] != 'P' || (bytes->data[1] != '5' && bytes->data[1] != '6'))
        return message_set(why, "%s: not a binary PGM or PPM file; convert it (magick plate.png plate.ppm)",
                           path);
    out->format = bytes->data[1] == '5' ? GAIT_GREY8 : GAIT_RGB8;
    out->width = header_number(&at);
    out->height = header_number(&at);
    if (header_number(&at) != 255 || out->width < 1 || out->height < 1 || out->width > GAIT_MAX_PIXELS ||
        out->height > GAIT_MAX_PIXELS)
        return message_set(why, "%s: damaged header, or not 8 bits per sample; write it again", path);
    out->data = at + 1;
    out->stride = out->width * (out->format == GAIT_GREY8 ? 1 : 3);
    size_t const wanted = (size_t)out->stride * (size_t)out->height;
    return bytes->size >= wanted + (size_t)(out->data - bytes->data) ||
           message_set(why, "%s: shorter than its header states; write it again", path);
}

bool pnm_read(const char *path, file_bytes *bytes, gait_image *out, message *why)
{
    if (!file_read(path, "background", FILE_MOST, bytes, why))
        return false;
    if (bytes->size > 2 && parse_pnm(path, bytes, out, why))
        return true;
    if (bytes->size <= 2)
        message_set(why, "%s: not a binary PGM or PPM file; convert it (magick plate.png plate.ppm)", path);
    free(bytes->data);
    *bytes = (file_bytes){0};
    return false;
}

/* ---- starts ---- */
/* Keys of the file besides the pelvis, with their fields of gait_state, whose table has the ranges.  sd: used if the file
 * gives a value without a standard deviation, the same as in python/gait/bindings/initial.py. */
static const struct {
    const char *key, *field, *remedy;
    double sd;
} scalars[] = {
    {"heading_rad", "heading", "give the walking direction about z in radians, 0 = along +x", 0.1},
    {"phase", "phase", "give the phase of the stride from 0 (right heel strike) to 1", 0.05},
    {"stride_hz", "stride_hz", "give strides (two steps) per second, about 0.9", 0.05},
    {"stature_m", "stature", "give the person's height in metres", 0.03},
};
/* "sd" may contain the first five. */
static const char *const known_keys[] = {"pelvis",    "heading_rad", "phase", "stride_hz",
                                         "stature_m", "frame",       "sd"};

enum { SCALARS = sizeof scalars / sizeof *scalars, KNOWN_KEYS = sizeof known_keys / sizeof *known_keys };
static const double PELVIS_SD = 0.05, MAX_SD = 10;

/* A field of gait_state. */
static gait_field state_field(const char *name)
{
    gait_field f = {0};
    for (uint32_t i = 0; gait_field_at(i, &f) == GAIT_OK; i++)
        if (strcmp(f.of, "gait_state") == 0 && strcmp(f.name, name) == 0)
            break;
    return f;
}

static void put(gait_state *s, size_t offset, double value)
{
    float const narrow = (float)value;
    memcpy((char *)s + offset, &narrow, sizeof narrow);
}

/* `sds`: the object of standard deviations, or -1. */
static bool read_scalar(const fields *f, int sds, int k, init_state *io, message *why)
{
    const char *const key = scalars[k].key;
    gait_field const field = state_field(scalars[k].field);
    double value;
    if (json_find(&f->doc, 0, key) >= 0) {
        if (!fields_numbers(f, 0, key, &value, 1, field.low, field.high, scalars[k].remedy, why))
            return false;
        put(&io->mean, field.offset, value);
        put(&io->sd, field.offset, scalars[k].sd);
    }
    if (sds >= 0 && json_find(&f->doc, sds, key) >= 0) {
        if (!fields_numbers(f, sds, key, &value, 1, 0, MAX_SD, "give a standard deviation, not negative",
                            why))
            return false;
        put(&io->sd, field.offset, value);
    }
    return true;
}

/* Number of values of a key; 0 if it is absent. */
static int count_of(const fields *f, int object, const char *key)
{
    int const value = object < 0 ? -1 : json_find(&f->doc, object, key);
    return value < 0 ? 0 : json_numbers(&f->doc, value, NULL, 0);
}

/* If only x and y are given, z is the model's height of the pelvis, which depends on the rest of the state. */
static bool read_pelvis(const fields *f, int sds, const gait_model *model, init_state *io, message *why)
{
    const char *const place = "give x and y (and z if known) of the pelvis in metres";
    int const known_axes = count_of(f, 0, "pelvis") == 3 ? 3 : 2, sd_count = count_of(f, sds, "pelvis");
    gait_field const field = state_field("pelvis");
    double value[3];
    if (json_find(&f->doc, 0, "pelvis") >= 0) {
        if (!fields_numbers(f, 0, "pelvis", value, known_axes, field.low, field.high, place, why))
            return false;
        for (int i = 0; i < 3; i++) {
            io->mean.pelvis[i] = i < known_axes ? (float)value[i] : io->mean.pelvis[i];
            io->sd.pelvis[i] = (float)PELVIS_SD;
        }
    }
    if (known_axes == 2 && gait_model_pelvis_height(model, &io->mean, &io->mean.pelvis[2], NULL) != GAIT_OK)
        return message_set(why, "%s: the model has no height for the pelvis; give z too", f->path);
    if (sd_count != 0) {
        if (!fields_numbers(f, sds, "pelvis", value, sd_count == 3 ? 3 : 1, 0, MAX_SD,
                            "give one number or three, metres", why))
            return false;
        for (int i = 0; i < 3; i++)
            io->sd.pelvis[i] = (float)value[sd_count == 3 ? i : 0];
    }
    return true;
}

static bool parse_init(const fields *f, const gait_model *model, init_state *io, message *why)
{
    int const sds = json_find(&f->doc, 0, "sd");
    if (!fields_only(f, 0, known_keys, KNOWN_KEYS, why))
        return false;
    if (sds >= 0 && f->node[sds].type != JSON_OBJECT)
        return message_set(why, "%s: sd is not an object; give standard deviations by key", f->path);
    if (sds >= 0 && !fields_only(f, sds, known_keys, SCALARS + 1, why))
        return false;
    if (json_find(&f->doc, 0, "frame") >= 0 &&
        !fields_whole(f, "frame", &io->frame, 0, 1u << 31, "give the frame number, from 0", why))
        return false;
    for (int k = 0; k < SCALARS; k++)
        if (!read_scalar(f, sds, k, io, why))
            return false;
    io->mean.phase -= floorf(io->mean.phase);
    return read_pelvis(f, sds, model, io, why);
}

bool init_file_read(const char *path, const gait_model *model, init_state *out, message *why)
{
    fields f;
    init_state state = {.frame = -1};
    if (gait_tracker_prior(model, &state.mean, &state.sd, NULL) != GAIT_OK)
        return message_set(why, "%s: the model has no prior", path);
    bool const ok = fields_open(&f, path, "init", why) && parse_init(&f, model, &state, why);
    fields_close(&f);
    if (ok)
        *out = state;
    return ok;
}
