#include "image/image.h"

int32_t image_channels(int32_t format)
{
    switch (format) {
    case GAIT_GREY8:
        return 1;
    case GAIT_RGB8:
    case GAIT_BGR8:
        return 3;
    default:
        return 0;
    }
}

bool image_valid(const gait_image *im, int32_t w, int32_t h)
{
    int64_t const channels = image_channels(im->format);
    return im->data && channels > 0 && im->width == w && im->height == h && w > 0 && h > 0 &&
           im->stride >= channels * w;
}
