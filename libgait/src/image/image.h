/* image.h - checks of the caller's image views. */
#ifndef GAIT_IMAGE_IMAGE_H
#define GAIT_IMAGE_IMAGE_H
#include "base/base.h"

/* Bytes per pixel of a GAIT_* format; 0 if unknown. */
int32_t image_channels(int32_t format);

/* im has pixels, a known format, the size w x h and rows that do not overlap. */
bool image_valid(const gait_image *im, int32_t w, int32_t h);
#endif
