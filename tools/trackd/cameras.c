#include "cameras.h"

#include "json.h"

#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

static float dot(const float *a, const float *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Whether the rows of R are orthogonal, of length 1 to 1e-3 as in the library, and right-handed; `name` is the file or
 * message in the error. */
static bool check_rotation(const gait_camera *camera, const char *name, message *why)
{
    const float *const a = camera->R, *const b = a + 3, *const c = a + 6;
    float const cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    float const fault[] = {dot(a, a) - 1, dot(b, b) - 1, dot(c, c) - 1, dot(a, b), dot(a, c), dot(b, c)};
    bool ok = dot(cross, c) > 0;
    for (size_t i = 0; i < sizeof fault / sizeof *fault; i++)
        ok = ok && fabsf(fault[i]) <= 1e-3f;
    return ok ||
           message_set(why, "%s: R is not a rotation; its rows must be orthogonal, of length 1, right-handed",
                       name);
}

/* Whether the principal point is near the middle of the picture and not that of a resized one, as Python requires of every
 * file. */
static bool check_middle(const gait_camera *c, const char *name, message *why)
{
    float const cropped = 0.7f, resized = 0.2f, alike = 0.05f;
    /* sizes of the picture of which it is the middle, relative to this one's */
    float const x = (2 * c->cx + 1) / (float)c->width, y = (2 * c->cy + 1) / (float)c->height;
    bool const near = fabsf(x - 1) <= cropped && fabsf(y - 1) <= cropped;
    bool const other = fmaxf(fabsf(x - 1), fabsf(y - 1)) > resized && fabsf(x - y) < alike * fmaxf(x, y);
    return (near && !other) ||
           message_set(why, "%s: principal point (%g, %g) is not near the middle of %dx%d pixels; %s", name,
                       (double)c->cx, (double)c->cy, c->width, c->height, "give cx and cy for this size");
}

bool camera_plausible(const gait_camera *camera, const char *name, message *why)
{
    gait_error err;
    return gait_camera_check(camera, &err) == GAIT_OK || message_set(why, "%.100s: %s", name, err.text);
}

/* ---- files ---- */
static bool read_pixels(const fields *f, const char *key, int32_t *out, message *why)
{
    int64_t value = 0;
    bool const ok =
        fields_whole(f, key, &value, 1, GAIT_MAX_PIXELS, "give the size of the video in whole pixels", why);
    *out = (int32_t)value;
    return ok;
}

static bool read_numbers(const fields *f, const char *key, float *out, int count, double low, double high,
                         const char *remedy, message *why)
{
    double value[9];
    if (!fields_numbers(f, 0, key, value, count, low, high, remedy, why))
        return false;
    for (int i = 0; i < count; i++)
        out[i] = (float)value[i];
    return true;
}

/* 0, 4 or 5 numbers; without the key the lens is ideal. */
static bool read_distortion(const fields *f, float out[5], message *why)
{
    const char *const remedy = "give k1 k2 p1 p2 [k3] (0, 4 or 5 numbers)";
    int const value = json_find(&f->doc, 0, "distortion");
    int const count = value < 0 ? 0 : json_numbers(&f->doc, value, NULL, 0);
    memset(out, 0, 5 * sizeof *out);
    if (count != 0 && count != 4 && count != 5)
        return message_set(why, "%s: distortion is not such a list; %s", f->path, remedy);
    return count == 0 || read_numbers(f, "distortion", out, count, -1e3, 1e3, remedy, why);
}

static bool parse_camera(const fields *f, gait_camera *c, message *why)
{
    static const char *const known[] = {"width", "height", "fx", "fy",         "cx",
                                        "cy",    "R",      "t",  "distortion", "note"};
    if (!fields_only(f, 0, known, sizeof known / sizeof *known, why))
        return false;
    const char *const focal = "give the focal length in pixels", *const middle =
                                                                     "give the principal point in pixels";
    if (!read_pixels(f, "width", &c->width, why) || !read_pixels(f, "height", &c->height, why) ||
        !read_numbers(f, "fx", &c->fx, 1, 1e-3, 1e9, focal, why) ||
        !read_numbers(f, "fy", &c->fy, 1, 1e-3, 1e9, focal, why) ||
        !read_numbers(f, "cx", &c->cx, 1, -1e6, 1e6, middle, why) ||
        !read_numbers(f, "cy", &c->cy, 1, -1e6, 1e6, middle, why) ||
        !read_numbers(f, "R", c->R, 9, -2, 2, "give the rotation from world to camera, 3 rows of 3", why) ||
        !read_numbers(f, "t", c->t, 3, -1e4, 1e4,
                      "give the translation from world to camera, 3 numbers in metres", why) ||
        !read_distortion(f, c->distortion, why))
        return false;
    return check_middle(c, f->path, why) && check_rotation(c, f->path, why);
}

/* Kinds of file that `gait capture` reads and this program does not. */
static bool is_foreign(const char *path)
{
    static const char *const endings[] = {".toml", ".yaml", ".yml", ".xml", ".txt", ".pickle", ".pkl"};
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
    if (is_foreign(path))
        return message_set(why,
                           "%.100s: gait-trackd reads JSON only; give this file to `gait capture --camera`, "
                           "which sends it over LCM, and no --camera here",
                           path);
    bool const ok = fields_open(&f, path, "camera", why) && parse_camera(&f, &camera, why) &&
                    camera_plausible(&camera, path, why);
    fields_close(&f);
    if (ok)
        *out = camera;
    return ok;
}

/* ---- messages ---- */
int64_t camera_pixels(const gait_camera *camera)
{
    return (int64_t)camera->width * camera->height;
}

static bool within(const float *x, int count, float low, float high)
{
    bool ok = true;
    for (int i = 0; i < count; i++)
        ok = ok && x[i] >= low && x[i] <= high;
    return ok;
}

bool camera_check(const gait_camera *c, int64_t max_pixels, message *why)
{
    if (c->width < 1 || c->height < 1 || c->width > GAIT_MAX_PIXELS || c->height > GAIT_MAX_PIXELS)
        return message_set(why, "camera with a size of %dx%d; send 1 to %d", c->width, c->height,
                           GAIT_MAX_PIXELS);
    if (camera_pixels(c) > max_pixels)
        return message_set(why,
                           "camera with %dx%d pixels, more than the %" PRId64 " that --max-pixels leaves",
                           c->width, c->height, max_pixels);
    const float focal[2] = {c->fx, c->fy};
    if (!within(focal, 2, 1e-3f, 1e9f))
        return message_set(why, "camera with focal lengths %g and %g; send pixels", (double)c->fx,
                           (double)c->fy);
    if (!within(c->t, 3, -1e4f, 1e4f))
        return message_set(why, "camera with t = %g, %g, %g; send metres, within 10 km", (double)c->t[0],
                           (double)c->t[1], (double)c->t[2]);
    if (!within(c->distortion, 5, -1e3f, 1e3f))
        return message_set(why, "camera with a distortion outside [-1000, 1000]; send k1 k2 p1 p2 k3");
    return check_middle(c, "camera", why) && check_rotation(c, "camera", why);
}

bool camera_from_message(const gaitmsg_camera_t *in, int64_t max_pixels, gait_camera *out, message *why)
{
    gait_camera c = {.width = in->width,
                     .height = in->height,
                     .fx = (float)in->fx,
                     .fy = (float)in->fy,
                     .cx = (float)in->cx,
                     .cy = (float)in->cy};
    for (int i = 0; i < 9; i++)
        c.R[i] = (float)in->R[i];
    for (int i = 0; i < 3; i++)
        c.t[i] = (float)in->t[i];
    for (int i = 0; i < 5; i++)
        c.distortion[i] = (float)in->distortion[i];
    if (!camera_check(&c, max_pixels, why))
        return false;
    *out = c;
    return true;
}

bool camera_same(const gait_camera *a, const gait_camera *b)
{
    enum { BEGIN = offsetof(gait_camera, fx), NUMBERS = (sizeof *a - BEGIN) / sizeof(float) };
    float x[NUMBERS], y[NUMBERS];
    memcpy(x, (const char *)a + BEGIN, sizeof x);
    memcpy(y, (const char *)b + BEGIN, sizeof y);
    bool same = a->width == b->width && a->height == b->height;
    for (int k = 0; k < NUMBERS; k++)
        same = same && fabsf(x[k] - y[k]) <= 1e-5f * fmaxf(1.0f, fabsf(x[k]));
    return same;
}

/* ---- streams ---- */
void camera_use(camera_slot *slot, const gait_camera *camera)
{
    *slot = (camera_slot){.known = true, .fixed = slot->fixed, .camera = *camera, .other_since = -1};
}

camera_answer camera_announced(camera_slot *slot, const gait_camera *camera, int64_t arrival)
{
    if (slot->known && camera_same(camera, &slot->camera)) {
        slot->provisional = false;
        slot->other_since = -1;
        return CAMERA_SAME;
    }
    if (slot->known && !slot->provisional) {
        if (slot->other_since < 0 || arrival < slot->other_since || !camera_same(camera, &slot->other)) {
            slot->other = *camera;
            slot->other_since = arrival;
        }
        if (slot->fixed || arrival - slot->other_since < CAMERA_SILENT) /* both are 0 or more */
            return CAMERA_REFUSED;
    }
    camera_use(slot, camera);
    return CAMERA_NEW;
}
