/* image.h - checks of the caller's images. */
#ifndef GAIT_IMAGE_IMAGE_H
#define GAIT_IMAGE_IMAGE_H
#include "base/base.h"

/* Bytes per pixel of a GAIT_* image format; 0 if the format is unknown. */
int32_t image_channels(int32_t format);

/* True if im has data, a known format, the size w x h and rows that do not overlap. */
bool image_valid(const gait_image *im, int32_t w, int32_t h);
#endif
