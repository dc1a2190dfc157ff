#include "api/check.h"

#include "api/fields.h"
#include "image/camera.h"
#include "image/view.h"

gait_result check_camera(const gait_camera *c, int32_t index, gait_error *err)
{
    int const number = index < 0 ? 0 : (int)index;
    if (!camera_valid(c))
        return base_fail(err, GAIT_ERR_ARG, (int)index, "camera %d: " CHECK_CAMERA, number);
    if (c->width > GAIT_MAX_PIXELS || c->height > GAIT_MAX_PIXELS)
        return base_fail(err, GAIT_ERR_LIMIT, (int)index, "camera %d: %d x %d pixels, at most %d each way",
                         number, (int)c->width, (int)c->height, GAIT_MAX_PIXELS);
    return GAIT_OK;
}

gait_result check_camera_pose(const gait_camera *c, int32_t index, const gait_camera_pose *pose,
                              gait_camera *out, gait_error *err)
{
    gait_camera const moved = camera_placed(c, pose->R, pose->t);
    gait_result s = fields_check("gait_camera_pose", pose, "pose: ", err);
    if (s == GAIT_OK)
        s = check_camera(&moved, index, err);
    if (s == GAIT_OK)
        *out = moved;
    return s;
}

gait_result check_image(const gait_camera *cam, int32_t camera, const gait_image *im, const char *what,
                        gait_error *err)
{
    if (!image_channels(im->format))
        return base_fail(err, GAIT_ERR_ARG, camera, "%s of camera %d has unknown format %d", what,
                         (int)camera, (int)im->format);
    if (im->width != cam->width || im->height != cam->height)
        return base_fail(err, GAIT_ERR_ARG, camera, "%s of camera %d is %d x %d, the camera is %d x %d", what,
                         (int)camera, (int)im->width, (int)im->height, (int)cam->width, (int)cam->height);
    int64_t const least = (int64_t)cam->width * image_channels(im->format);
    if (im->stride < least)
        return base_fail(err, GAIT_ERR_ARG, camera,
                         "%s of camera %d has stride %d, %d pixels of %s take at least %lld", what,
                         (int)camera, (int)im->stride, (int)cam->width,
                         least == cam->width ? "GAIT_GREY8" : "GAIT_RGB8 or GAIT_BGR8", (long long)least);
    return GAIT_OK;
}

gait_result check_pose(gait_result s, const char *function, gait_error *err)
{
    if (s == GAIT_OK)
        return s;
    return base_fail(err, s, -1,
                     "%s: the state holds a number that is not finite, or stature is not positive", function);
}
