#include "further.h"

#include "gaitmsg_image_t.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool further_open(further *f, const char *streams, int first, message *why)
{
    *f = (further){.before = -1};
    for (const char *at = streams; *at;) {
        char *end;
        long const stream = strtol(at, &end, 10);
        bool const number =
            end != at && (*end == '\0' || (*end == ',' && end[1])) && stream >= 0 && stream <= 30;
        if (!number || stream == first || further_find(f, (int)stream) || f->count == FURTHER_MOST)
            return message_set(why,
                               "--further-streams %.40s: give at most %d numbers of cameras other than "
                               "--stream, such as 1,2",
                               streams, FURTHER_MOST);
        f->camera[f->count++].stream = (int)stream;
        at = *end ? end + 1 : end;
    }
    return true;
}

void further_close(further *f)
{
    for (int i = 0; i < f->count; i++)
        free(f->camera[i].pixels);
    *f = (further){0};
}

further_camera *further_find(further *f, int stream)
{
    for (int i = 0; i < f->count; i++)
        if (f->camera[i].stream == stream)
            return &f->camera[i];
    return NULL;
}

const further_camera *further_unknown(const further *f)
{
    for (int i = 0; i < f->count; i++)
        if (!f->camera[i].slot.known)
            return &f->camera[i];
    return NULL;
}

static size_t picture_bytes(const gait_camera *c)
{
    return (size_t)c->width * (size_t)c->height * 3;
}

bool further_allocate(further_camera *c, message *why)
{
    free(c->pixels);
    c->bytes = (1 + FURTHER_PAST) * picture_bytes(&c->slot.camera);
    c->pixels = aligned_memory(c->bytes, "frames of a camera", why);
    c->background.data = NULL;
    for (int i = 0; i < FURTHER_PAST; i++)
        c->utime[i] = -1;
    if (!c->pixels) {
        c->slot.known = false;
        c->bytes = 0;
    }
    return c->slot.known;
}

/* Copy a picture to the place of this number. */
static bool copy(further_camera *c, const image_view *v, int place, gait_image *out, message *why)
{
    uint8_t *const to = c->pixels + (size_t)place * picture_bytes(&c->slot.camera);
    gait_image in;
    if (v->pixelformat == GAITMSG_IMAGE_T_PIXEL_FORMAT_MJPEG)
        return jpeg_decode(v->data, (size_t)v->size, c->slot.camera.width, c->slot.camera.height, to, out,
                           why);
    if (!image_view_pixels(v, c->slot.camera.width, c->slot.camera.height, &in, why))
        return false;
    int32_t const row = in.width * (in.format == GAIT_GREY8 ? 1 : 3);
    for (int32_t y = 0; y < in.height; y++)
        memcpy(to + (size_t)y * (size_t)row, in.data + (ptrdiff_t)y * in.stride, (size_t)row);
    *out = (gait_image){to, in.width, in.height, row, in.format};
    return true;
}

bool further_take_background(further_camera *c, const image_view *v, message *why)
{
    return !c->slot.known || copy(c, v, 0, &c->background, why);
}

bool further_take_frame(further_camera *c, const image_view *v, message *why)
{
    int const at = (int)(c->frames % FURTHER_PAST);
    if (!c->slot.known)
        return true; /* no fault: its camera is announced every few seconds */
    c->utime[at] = -1;
    if (!copy(c, v, 1 + at, &c->frame[at], why))
        return false;
    c->utime[at] = v->utime;
    c->frames++;
    return true;
}

static int64_t distance(int64_t a, int64_t b)
{
    return a > b ? a - b : b - a;
}

/* Half the interval between frames of the first camera. */
static int64_t reach(const further *f, int64_t utime)
{
    int64_t const interval = f->before < 0 ? FURTHER_APART : distance(utime, f->before);
    return (interval < FURTHER_APART ? interval : FURTHER_APART) / 2;
}

/* Place of the frame nearest to a time, at most so many microseconds away; -1: none. */
static int closest(const further_camera *c, int64_t utime, int64_t most)
{
    int best = -1;
    for (int k = 0; k < FURTHER_PAST; k++)
        if (c->utime[k] >= 0 && distance(c->utime[k], utime) <= most &&
            (best < 0 || distance(c->utime[k], utime) < distance(c->utime[best], utime)))
            best = k;
    return best;
}

/* Whether the pose of that frame may still arrive. */
static bool lacks_pose(const further_camera *c, int64_t utime, int64_t most)
{
    int const best = c->path ? closest(c, utime, most) : -1;
    gait_camera_pose pose;
    message why;
    return best >= 0 && pose_path_at(c->path, c->utime[best], &pose, &why) == POSE_LATER;
}

bool further_waits(const further *f, int64_t utime)
{
    int64_t const most = reach(f, utime);
    for (int i = 0; i < f->count; i++) {
        const further_camera *const c = &f->camera[i];
        int64_t newest = -1;
        for (int k = 0; k < FURTHER_PAST && c->slot.known; k++)
            newest = c->utime[k] > newest ? c->utime[k] : newest;
        if (c->slot.known && (newest < utime - most / 2 || lacks_pose(c, utime, most)))
            return true;
    }
    return false;
}

bool further_images(further *f, int64_t utime, gait_frame *frame, message *why)
{
    int64_t const most = reach(f, utime);
    bool placed = true;
    f->before = utime;
    for (int i = 0; i < f->count; i++) {
        further_camera *const c = &f->camera[i];
        int const best = closest(c, utime, most);
        bool const known = best < 0 || !c->path || pose_path_now(c->path, c->utime[best], &c->pose, why);
        bool const used = best >= 0 && known;
        placed = placed && known;
        c->used += used;
        c->missing += !used;
        if (used) {
            frame->image[1 + i] = c->frame[best];
            frame->pose[1 + i] = c->path ? &c->pose : NULL;
        }
    }
    return placed;
}
