#include "image_view.h"

#include "byte_reader.h"
#include "gaitmsg_image_t.h"

#include <string.h>

/* One key and value; the frame's number is kept. */
static void take_metadata(byte_reader *r, image_view *v)
{
    static const char name[] = "frame";
    int32_t const key_length = bytes_int32(r);
    const uint8_t *const key = bytes_take(r, key_length);
    int32_t const value_length = bytes_int32(r);
    if (key && key_length == (int32_t)sizeof name && memcmp(key, name, sizeof name) == 0 && value_length == 8)
        v->frame = bytes_int(r, 8);
    else
        bytes_take(r, value_length);
}

bool image_view_open(image_view *v, const void *message_bytes, size_t size, message *why)
{
    byte_reader r = {.at = message_bytes, .left = size, .ok = true};
    if (bytes_int(&r, 8) != __gaitmsg_image_t_get_hash())
        return message_set(why, "not a gaitmsg.image_t (another type or version)");
    v->utime = bytes_int(&r, 8);
    v->width = bytes_int32(&r);
    v->height = bytes_int32(&r);
    v->stride = bytes_int32(&r);
    v->pixelformat = bytes_int32(&r);
    v->size = bytes_int32(&r);
    v->data = bytes_take(&r, v->size);
    v->frame = -1;
    for (int32_t left = bytes_int32(&r); r.ok && left > 0; left--)
        take_metadata(&r, v);
    return r.ok || message_set(why, "damaged message: shorter than its lengths say");
}

bool image_view_pixels(const image_view *v, int32_t width, int32_t height, gait_image *out, message *why)
{
    static const struct {
        int32_t pixelformat, format, bytes;
        const char *name;
    } formats[] = {
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, GAIT_GREY8, 1, "grey"},
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_RGB, GAIT_RGB8, 3, "RGB"},
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_BGR, GAIT_BGR8, 3, "BGR"},
    };
    if (v->width != width || v->height != height)
        return message_set(why, "picture of %dx%d, the camera has %dx%d; send both alike", v->width,
                           v->height, width, height);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++) {
        if (v->pixelformat != formats[i].pixelformat)
            continue;
        int32_t const least = width * formats[i].bytes;
        if (v->stride < least)
            return message_set(why, "row_stride %d for %d pixels of %s; send at least %d", v->stride, width,
                               formats[i].name, least);
        if ((int64_t)v->stride * height > v->size)
            return message_set(why, "size %d of a picture of %d rows of %d bytes; send all of them", v->size,
                               height, v->stride);
        *out = (gait_image){v->data, width, height, v->stride, formats[i].format};
        return true;
    }
    return message_set(why, "pixelformat 0x%08x is not supported; send grey, RGB, BGR or JPEG",
                       (unsigned)v->pixelformat);
}
