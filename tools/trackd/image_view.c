#include "image_view.h"

#include "byte_reader.h"
#include "gaitmsg_image_t.h"

#include <string.h>

/* ---- JPEG ---- */
#ifdef HAVE_LIBJPEG
/* clang-format off: jpeglib.h needs stdio.h before it */
#include <setjmp.h>
#include <stdio.h>
#include <jpeglib.h>
/* clang-format on */

bool jpeg_supported(void)
{
    return true;
}

typedef struct failure {
    struct jpeg_error_mgr base; /* first member: libjpeg gets a pointer to it */
    jmp_buf back;
    message *why;
} failure;

static void on_error(j_common_ptr info)
{
    failure *const f = (failure *)(void *)info->err;
    char text[JMSG_LENGTH_MAX];
    info->err->format_message(info, text);
    message_set(f->why, "JPEG frame cannot be decoded: %s", text);
    longjmp(f->back, 1);
}

/* A damaged image is an error, not a warning and grey pixels. */
static void on_message(j_common_ptr info, int level)
{
    if (level < 0)
        on_error(info);
}

static bool decode(struct jpeg_decompress_struct *info, int32_t width, int32_t height, uint8_t *pixels,
                   gait_image *out, message *why)
{
    jpeg_read_header(info, TRUE);
    if ((int32_t)info->image_width != width || (int32_t)info->image_height != height)
        return message_set(why, "JPEG frame of %ux%u, but the camera has %dx%d; send equal sizes",
                           info->image_width, info->image_height, width, height);
    bool const grey = info->num_components == 1;
    info->out_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
    info->dct_method = JDCT_ISLOW;
    jpeg_start_decompress(info);
    *out = (gait_image){pixels, width, height, width * (grey ? 1 : 3), grey ? GAIT_GREY8 : GAIT_RGB8};
    while (info->output_scanline < info->output_height) {
        JSAMPROW row = pixels + (size_t)info->output_scanline * (size_t)out->stride;
        jpeg_read_scanlines(info, &row, 1);
    }
    jpeg_finish_decompress(info);
    return true;
}

bool jpeg_decode(const uint8_t *data, size_t size, int32_t width, int32_t height, uint8_t *pixels,
                 gait_image *out, message *why)
{
    struct jpeg_decompress_struct info;
    failure f = {.why = why};
    info.err = jpeg_std_error(&f.base);
    f.base.error_exit = on_error;
    f.base.emit_message = on_message;
    if (setjmp(f.back)) {
        jpeg_destroy_decompress(&info);
        return false;
    }
    jpeg_create_decompress(&info);
    jpeg_mem_src(&info, data, (unsigned long)size);
    bool const ok = decode(&info, width, height, pixels, out, why);
    jpeg_destroy_decompress(&info);
    return ok;
}
#else
bool jpeg_supported(void)
{
    return false;
}

bool jpeg_decode(const uint8_t *data, size_t size, int32_t width, int32_t height, uint8_t *pixels,
                 gait_image *out, message *why)
{
    (void)data, (void)size, (void)width, (void)height, (void)pixels, (void)out;
    return message_set(
        why, "JPEG frame, but this gait-trackd was built without libjpeg; send grey, RGB or BGR, or "
             "install libjpeg-dev and build again");
}
#endif

/* ---- messages ---- */
/* Read one key and value; keep the frame number. */
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
    return r.ok ? clock_check(v->utime, why)
                : message_set(why, "damaged message: shorter than its lengths state");
}

bool image_view_pixels(const image_view *v, int32_t width, int32_t height, gait_image *out, message *why)
{
    static const struct {
        int32_t pixelformat;
        gait_pixel_format format;
        int32_t bytes;
        const char *name;
    } formats[] = {
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_GRAY, GAIT_GREY8, 1, "grey"},
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_RGB, GAIT_RGB8, 3, "RGB"},
        {GAITMSG_IMAGE_T_PIXEL_FORMAT_BGR, GAIT_BGR8, 3, "BGR"},
    };
    if (v->width != width || v->height != height)
        return message_set(why, "image of %dx%d, but the camera has %dx%d; send equal sizes", v->width,
                           v->height, width, height);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++) {
        if (v->pixelformat != formats[i].pixelformat)
            continue;
        int32_t const least = width * formats[i].bytes;
        if (v->stride < least)
            return message_set(why, "row_stride %d for %d pixels of %s; send at least %d", v->stride, width,
                               formats[i].name, least);
        if ((int64_t)v->stride * height > v->size)
            return message_set(why, "size %d for an image of %d rows of %d bytes; send all of them", v->size,
                               height, v->stride);
        *out = (gait_image){v->data, width, height, v->stride, formats[i].format};
        return true;
    }
    return message_set(why, "pixelformat 0x%08x is not supported; send grey, RGB, BGR or JPEG",
                       (unsigned)v->pixelformat);
}
