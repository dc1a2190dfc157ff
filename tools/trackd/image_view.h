/* image_view.h - look into an encoded gaitmsg.image_t where it lies: every length is checked, nothing is copied.
 * The generated decoder allocates, and trusts the lengths in the message. */
#ifndef TRACKD_IMAGE_VIEW_H
#define TRACKD_IMAGE_VIEW_H
#include "gait.h"
#include "message.h"

typedef struct image_view {
    int64_t utime;
    int64_t frame; /* metadata "frame"; -1: none */
    int32_t width, height, stride;
    int32_t pixelformat; /* GAITMSG_IMAGE_T_PIXEL_FORMAT_* or anything else */
    int32_t size;
    const uint8_t *data;
} image_view;

bool image_view_open(image_view *v, const void *message_bytes, size_t size, message *why);
/* The pixels, when they are uncompressed, of a known format and of the camera's size. */
bool image_view_pixels(const image_view *v, int32_t width, int32_t height, gait_image *out, message *why);
#endif
