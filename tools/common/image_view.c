#include "image_view.h"

#include "gaitmsg_image_t.h"

#include <string.h>

typedef struct reader {
    const uint8_t *at;
    size_t left;
    bool ok; /* false: something lay beyond the end */
} reader;

/* `count` bytes of the message, or NULL beyond its end. */
static const uint8_t *take(reader *r, int64_t count)
{
    const uint8_t *const at = r->at;
    if (!r->ok || count < 0 || (uint64_t)count > r->left) {
        r->ok = false;
        return NULL;
    }
    r->at += count;
    r->left -= (size_t)count;
    return at;
}

/* Big-endian, as LCM writes integers. */
static int64_t take_int(reader *r, int bytes)
{
    const uint8_t *const at = take(r, bytes);
    uint64_t value = 0;
    for (int i = 0; at && i < bytes; i++)
        value = value << 8 | at[i];
    return bytes == 4 ? (int32_t)(uint32_t)value : (int64_t)value;
}

static int32_t take_int32(reader *r)
{
    return (int32_t)take_int(r, 4);
}

/* One key and value; the frame's number is kept. */
static void take_metadata(reader *r, image_view *v)
{
    static const char name[] = "frame";
    int32_t const key_length = take_int32(r);
    const uint8_t *const key = take(r, key_length);
    int32_t const value_length = take_int32(r);
    if (key && key_length == (int32_t)sizeof name && memcmp(key, name, sizeof name) == 0 && value_length == 8)
        v->frame = take_int(r, 8);
    else
        take(r, value_length);
}

bool image_view_open(image_view *v, const void *message_bytes, size_t size, message *why)
{
    reader r = {.at = message_bytes, .left = size, .ok = true};
    if (take_int(&r, 8) != __gaitmsg_image_t_get_hash())
        return message_set(why, "not a gaitmsg.image_t (another type or version)");
    v->utime = take_int(&r, 8);
    v->width = take_int32(&r);
    v->height = take_int32(&r);
    v->stride = take_int32(&r);
    v->pixelformat = take_int32(&r);
    v->size = take_int32(&r);
    v->data = take(&r, v->size);
    v->frame = -1;
    for (int32_t left = take_int32(&r); r.ok && left > 0; left--)
        take_metadata(&r, v);
    return r.ok || message_set(why, "damaged message: shorter than its lengths say");
}

bool image_view_pixels(const image_view *v, int32_t width, int32_t height, gait_image *out, message *why)
{
    static const struct {
        int32_t pixelformat, format, bytes;
    } formats[] = {
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, GAIT_GREY8, 1},
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_RGB, GAIT_RGB8, 3},
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_BGR, GAIT_BGR8, 3},
    };
    if (v->width != width || v->height != height)
        return message_set(why, "picture of %dx%d, the camera has %dx%d; send both alike", v->width,
                           v->height, width, height);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++) {
        if (v->pixelformat != formats[i].pixelformat)
            continue;
        if (v->stride < width * formats[i].bytes || (int64_t)v->stride * height > v->size)
            return message_set(why, "row_stride %d or size %d too small for %dx%d", v->stride, v->size, width,
                               height);
        *out = (gait_image){v->data, width, height, v->stride, formats[i].format};
        return true;
    }
    return message_set(why, "pixelformat 0x%08x is not supported; send grey, RGB, BGR or JPEG",
                       (unsigned)v->pixelformat);
}
