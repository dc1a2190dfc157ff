/* view.h - the region of interest of one camera, resampled so that the person has a fixed size in it.
 *
 * All image evidence is measured in this working image of VIEW_SIZE x VIEW_SIZE pixels, in which the
 * predicted person is about VIEW_PERSON pixels tall whatever the camera's resolution. Cost and constants
 * therefore do not depend on the distance. Two working pixels make one cell of the grid. */
#ifndef GAIT_IMAGE_VIEW_H
#define GAIT_IMAGE_VIEW_H
#include "base/arena.h"
#include "gait.h"
#include "base/dispatch.h"
#include <stdbool.h>

enum { VIEW_SIZE = 256, VIEW_PIXELS = VIEW_SIZE * VIEW_SIZE, VIEW_PERSON = 192 };

typedef struct view_map { /* working = (pixel - origin) * scale, ideal (undistorted) pixels */
    float scale, u0, v0;
} view_map;

typedef struct view_planes { /* resampled planes: R, G, B, or grey in the first */
    uint8_t *channel[3];     /* VIEW_PIXELS each */
    int32_t channels;
} view_planes;

/* Bytes per pixel of a GAIT_* image format; 0 if the format is unknown. */
static inline int32_t image_channels(gait_pixel_format format)
{
    return format == GAIT_GREY8 ? 1 : format == GAIT_RGB8 || format == GAIT_BGR8 ? 3 : 0;
}

/* Centre and scale the region on a person whose middle is at pixel uv and who is `tall` pixels high. Returns
 * false and keeps the map while the person stays well inside it, so that static pixels are not resampled
 * differently from frame to frame. */
bool view_follow(view_map *map, const float uv[2], float tall);

/* Kernels (base/dispatch.h); view_rows and view_grey process working rows begin .. end - 1:
 *
 *    view_rows    resample one captured frame (bilinear, or the mean of a box of pixels where the working image is
 *                 coarser) and undo the lens distortion; out has as many planes as the frame has channels
 *    view_inside  cells whose source pixel lies inside the frame, as bits of the grid
 *    view_grey    luma of the planes: (77 R + 150 G + 29 B) / 256; grey may be one of the planes */
view_planes view_planes_layout(arena *a, int32_t channels);

/* Resample all rows of a frame, and set the number of planes. */
void view_sample(const kernels *run, const view_map *map, const gait_camera *cam, const gait_image *im,
                 view_planes *out);
#endif
