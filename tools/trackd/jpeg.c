#include "jpeg.h"

#ifdef HAVE_LIBJPEG
/* clang-format off: jpeglib.h needs the others before it */
#include <setjmp.h>
#include <stdio.h>
#include <jpeglib.h>
/* clang-format on */

bool jpeg_supported(void)
{
    return true;
}

typedef struct failure {
    struct jpeg_error_mgr base; /* first: libjpeg knows only this */
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

/* A damaged picture is an error, not a warning and grey pixels. */
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
        return message_set(why, "JPEG frame of %ux%u, the camera has %dx%d; send both alike",
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
