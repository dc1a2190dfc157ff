#include "frame_hold.h"

#include <stdlib.h>
#include <string.h>

enum { BESIDE_PIXELS = 1 << 16 }; /* of an image_t: fields, metadata, padding of rows */

void frame_hold_close(frame_hold *h)
{
    free(h->frame);
    *h = (frame_hold){0};
}

bool frame_hold_allocate(frame_hold *h, const gait_camera *camera, message *why)
{
    size_t const bytes = (size_t)camera->width * (size_t)camera->height * 3 + BESIDE_PIXELS;
    frame_hold_close(h);
    h->frame = malloc(bytes);
    h->capacity = h->frame ? bytes : 0;
    return h->frame || message_set(why, "not enough memory for a waiting frame of %zu bytes", bytes);
}

bool frame_hold_keep(frame_hold *h, int64_t utime, const void *image, size_t bytes, int64_t arrival)
{
    if (!h->frame || bytes > h->capacity)
        return false;
    memcpy(h->frame, image, bytes);
    h->bytes = bytes;
    h->utime = utime;
    h->arrival = arrival;
    return true;
}
