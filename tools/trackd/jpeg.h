/* jpeg.h - JPEG frames, where the build found libjpeg. */
#ifndef TRACKD_JPEG_H
#define TRACKD_JPEG_H
#include "gait.h"
#include "message.h"

/* Whether this build decodes JPEG. */
bool jpeg_supported(void);
/* Decode into `pixels`, which has room for width x height x 3 bytes: grey stays grey, anything else becomes RGB. */
bool jpeg_decode(const uint8_t *data, size_t size, int32_t width, int32_t height, uint8_t *pixels,
                 gait_image *out, message *why);
#endif
