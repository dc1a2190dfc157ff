#include "image/image.h"

#include "check.h"

int main(void)
{
    static uint8_t pixels[48];
    gait_image im = {.data = pixels, .width = 4, .height = 3, .stride = 12, .format = GAIT_RGB8};
    CHECK(image_channels(GAIT_GREY8) == 1);
    CHECK(image_channels(GAIT_RGB8) == 3 && image_channels(GAIT_BGR8) == 3);
    CHECK(image_channels(0) == 0 && image_channels(4) == 0 && image_channels(-1) == 0);
    CHECK(image_valid(&im, 4, 3));
    CHECK(!image_valid(&im, 3, 4) && !image_valid(&im, 4, 4) && !image_valid(&im, 5, 3));
    im.stride = 11;
    CHECK(!image_valid(&im, 4, 3));
    im.stride = 16;
    CHECK(image_valid(&im, 4, 3));
    im.stride = -16;
    CHECK(!image_valid(&im, 4, 3));
    im.stride = 4;
    im.format = GAIT_GREY8;
    CHECK(image_valid(&im, 4, 3));
    im.format = 9;
    CHECK(!image_valid(&im, 4, 3));
    im.format = GAIT_GREY8;
    im.data = NULL;
    CHECK(!image_valid(&im, 4, 3));
    gait_image const empty = {.data = pixels, .format = GAIT_GREY8};
    CHECK(!image_valid(&empty, 0, 0));
    im = (gait_image){.data = pixels, .width = INT32_MAX, .height = 1, .stride = 16, .format = GAIT_RGB8};
    CHECK(!image_valid(&im, INT32_MAX, 1)); /* 3 x width wraps in 32 bits */
    return CHECK_DONE();
}
