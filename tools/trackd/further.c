#include "further.h"

#include "cameras.h"
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
        if (!f->camera[i].known)
            return &f->camera[i];
    return NULL;
}

static size_t picture_bytes(const gait_camera *c)
{
    return (size_t)c->width * (size_t)c->height * 3;
}

size_t further_bytes(const further_camera *c)
{
    return (1 + FURTHER_PAST) * picture_bytes(&c->camera);
}

bool further_set_camera(further_camera *c, const gait_camera *camera, message *why)
{
    c->camera = *camera;
    c->pixels = aligned_memory(further_bytes(c), "frames of a camera", why);
    if (!c->pixels)
        return false;
    for (int i = 0; i < FURTHER_PAST; i++)
        c->utime[i] = -1;
    c->known = true;
    return true;
}

bool further_take_camera(further_camera *c, const gaitmsg_camera_t *in, int32_t max_pixels, message *why)
{
    gait_camera camera;
    char channel[24];
    if (!camera_from_message(in, max_pixels, &camera, why))
        return false;
    snprintf(channel, sizeof channel, "GAIT_CAMERA_%d", c->stream);
    if (!camera_plausible(&camera, channel, why))
        return false;
    if (c->known)
        return camera_same(&camera, &c->camera) ||
               message_set(why, "another camera on GAIT_CAMERA_%d than before is ignored; start anew with it",
                           c->stream);
    return further_set_camera(c, &camera, why);
}

/* Copy a picture to the place of this number. */
static bool copy(further_camera *c, const image_view *v, int place, gait_image *out, message *why)
{
    uint8_t *const to = c->pixels + (size_t)place * picture_bytes(&c->camera);
    gait_image in;
    if (v->pixelformat == GAITMSG_IMAGE_T_PIXEL_FORMAT_MJPEG)
        return jpeg_decode(v->data, (size_t)v->size, c->camera.width, c->camera.height, to, out, why);
    if (!image_view_pixels(v, c->camera.width, c->camera.height, &in, why))
        return false;
    int32_t const row = in.width * (in.format == GAIT_GREY8 ? 1 : 3);
    for (int32_t y = 0; y < in.height; y++)
        memcpy(to + (size_t)y * (size_t)row, in.data + (ptrdiff_t)y * in.stride, (size_t)row);
    *out = (gait_image){to, in.width, in.height, row, in.format};
    return true;
}

bool further_take_background(further_camera *c, const image_view *v, message *why)
{
    return !c->known || copy(c, v, 0, &c->background, why);
}

bool further_take_frame(further_camera *c, const image_view *v, message *why)
{
    int const at = (int)(c->frames % FURTHER_PAST);
    if (!c->known)
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

bool further_waits(const further *f, int64_t utime)
{
    for (int i = 0; i < f->count; i++) {
        const further_camera *const c = &f->camera[i];
        int64_t newest = -1;
        for (int k = 0; k < FURTHER_PAST && c->known; k++)
            newest = c->utime[k] > newest ? c->utime[k] : newest;
        if (c->known && newest < utime - reach(f, utime) / 2)
            return true;
    }
    return false;
}

void further_images(further *f, int64_t utime, gait_frame *frame)
{
    int64_t const most = reach(f, utime);
    f->before = utime;
    for (int i = 0; i < f->count; i++) {
        further_camera *const c = &f->camera[i];
        int best = -1;
        for (int k = 0; k < FURTHER_PAST; k++)
            if (c->utime[k] >= 0 && distance(c->utime[k], utime) <= most &&
                (best < 0 || distance(c->utime[k], utime) < distance(c->utime[best], utime)))
                best = k;
        c->used += best >= 0;
        c->missing += best < 0;
        if (best >= 0)
            frame->image[1 + i] = c->frame[best];
    }
}
