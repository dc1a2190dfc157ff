#include "api/check.h"

#include "image/camera.h"
#include "raster/rast.h"

gait_result check_camera(const gait_camera *c, int32_t index, gait_error *err)
{
    int const number = index < 0 ? 0 : (int)index;
    if (!camera_valid(c))
        return base_fail(
            err, GAIT_ERR_ARG, (int)index,
            "camera %d: size and focal lengths must be positive, R a rotation, all numbers finite", number);
    if (c->width > RAST_LIMIT || c->height > RAST_LIMIT)
        return base_fail(err, GAIT_ERR_LIMIT, (int)index, "camera %d: %d x %d pixels, at most %d each way",
                         number, (int)c->width, (int)c->height, RAST_LIMIT);
    return GAIT_OK;
}
