/* image_view.h - read an encoded gaitmsg.image_t in place, and decode JPEG. */
#ifndef TRACKD_IMAGE_VIEW_H
#define TRACKD_IMAGE_VIEW_H
#include "common.h"
#include "gait.h"

/* ---- JPEG frames, where the build found libjpeg. */
/* Whether this build decodes JPEG. */
bool jpeg_supported(void);
/* Decode into `pixels` of width x height x 3 bytes: grey stays grey, any other colour space becomes RGB. */
bool jpeg_decode(const uint8_t *data, size_t size, int32_t width, int32_t height, uint8_t *pixels,
                 gait_image *out, message *why);

/* ---- messages: read in place, every length checked, nothing copied.  The generated decoder allocates and trusts the
 * lengths in the message. */
typedef struct image_view {
    int64_t utime;
    int64_t frame; /* metadata "frame"; -1: none */
    int32_t width, height, stride;
    int32_t pixelformat; /* GAITMSG_IMAGE_T_PIXEL_FORMAT_* or anything else */
    int32_t size;
    const uint8_t *data;
} image_view;

bool image_view_open(image_view *v, const void *message_bytes, size_t size, message *why);
/* The pixels, if they are uncompressed, of a known format and of the camera's size. */
bool image_view_pixels(const image_view *v, int32_t width, int32_t height, gait_image *out, message *why);
#endif
