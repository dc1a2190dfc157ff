#include "camera_file.h"

#include "fields.h"

#include <math.h>
#include <string.h>

static double dot(const float *a, const float *b)
{
    return (double)a[0] * b[0] + (double)a[1] * b[1] + (double)a[2] * b[2];
}

bool camera_rotation_ok(const gait_camera *camera)
{
    const float *const a = camera->R, *const b = a + 3, *const c = a + 6;
    float const cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    double const fault[] = {dot(a, a) - 1, dot(b, b) - 1, dot(a, b), dot(cross, c) - 1};
    double worst = 0;
    for (size_t i = 0; i < sizeof fault / sizeof *fault; i++)
        worst = fmax(worst, fabs(fault[i]));
    return worst < 3e-3;
}

static bool whole(const fields *f, const char *key, int32_t *out, message *why)
{
    int64_t value = 0;
    bool const ok =
        fields_whole(f, key, &value, 1, CAMERA_PIXELS, "give the size of the video in whole pixels", why);
    *out = (int32_t)value;
    return ok;
}

static bool real(const fields *f, const char *key, float *out, int count, double low, double high,
                 const char *remedy, message *why)
{
    double value[9];
    if (!fields_numbers(f, 0, key, value, count, low, high, remedy, why))
        return false;
    for (int i = 0; i < count; i++)
        out[i] = (float)value[i];
    return true;
}

/* 0, 4 or 5 numbers; an absent key is an ideal lens. */
static bool lens(const fields *f, float out[5], message *why)
{
    const char *const remedy = "give k1 k2 p1 p2 [k3] (0, 4 or 5 numbers)";
    int const value = fields_find(f, 0, "distortion");
    int const count = value < 0 ? 0 : json_numbers(&f->doc, value, NULL, 0);
    memset(out, 0, 5 * sizeof *out);
    if (count != 0 && count != 4 && count != 5)
        return message_set(why, "%s: distortion is not such a list; %s", f->path, remedy);
    return count == 0 || real(f, "distortion", out, count, -1e3, 1e3, remedy, why);
}

static bool parse(const fields *f, gait_camera *c, message *why)
{
    static const char *const known[] = {"width", "height", "fx", "fy",         "cx",
                                        "cy",    "R",      "t",  "distortion", "note"};
    if (!fields_only(f, 0, known, sizeof known / sizeof *known, why))
        return false;
    const char *const focal = "give the focal length in pixels", *const middle =
                                                                     "give the principal point in pixels";
    if (!whole(f, "width", &c->width, why) || !whole(f, "height", &c->height, why) ||
        !real(f, "fx", &c->fx, 1, 1e-3, 1e9, focal, why) ||
        !real(f, "fy", &c->fy, 1, 1e-3, 1e9, focal, why) ||
        !real(f, "cx", &c->cx, 1, -1e6, 1e6, middle, why) ||
        !real(f, "cy", &c->cy, 1, -1e6, 1e6, middle, why) ||
        !real(f, "R", c->R, 9, -2, 2, "give the rotation from world to camera, 3 rows of 3", why) ||
        !real(f, "t", c->t, 3, -1e6, 1e6, "give the translation from world to camera, 3 numbers in metres",
              why) ||
        !lens(f, c->distortion, why))
        return false;
    return camera_rotation_ok(c) ||
           message_set(why, "%s: R is not a rotation; its rows must be orthogonal, of length 1, right-handed",
                       f->path);
}

/* The kinds of file that `gait capture` reads and this program does not. */
static bool others_kind(const char *path)
{
    static const char *const endings[] = {".toml", ".yaml", ".yml", ".xml"};
    const char *const folder = strrchr(path, '/'), *const name = folder ? folder + 1 : path;
    size_t const length = strcspn(name, ":"); /* FILE.toml:name chooses a camera */
    for (size_t i = 0; i < sizeof endings / sizeof *endings; i++) {
        size_t const n = strlen(endings[i]);
        if (length >= n && memcmp(name + length - n, endings[i], n) == 0)
            return true;
    }
    return false;
}

bool camera_file_read(const char *path, gait_camera *out, message *why)
{
    fields f;
    gait_camera camera = {0};
    if (others_kind(path))
        return message_set(why,
                           "%.100s: gait-trackd reads JSON only; give this file to `gait capture --camera`, "
                           "which sends it over LCM, and no --camera here",
                           path);
    bool const ok = fields_open(&f, path, "camera", why) && parse(&f, &camera, why);
    fields_close(&f);
    if (ok)
        *out = camera;
    return ok;
}
