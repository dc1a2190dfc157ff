/* image.h - formats of the caller's images. */
#ifndef GAIT_IMAGE_IMAGE_H
#define GAIT_IMAGE_IMAGE_H
#include "base/base.h"

/* Bytes per pixel of a GAIT_* image format; 0 if the format is unknown. */
static inline int32_t image_channels(gait_pixel_format format)
{
    return format == GAIT_GREY8 ? 1 : format == GAIT_RGB8 || format == GAIT_BGR8 ? 3 : 0;
}
#endif
