#include "image/view.h"
#include "base/base.h"

view_planes view_planes_layout(arena *a, int32_t channels)
{
    view_planes p = {.channels = channels};
    for (int32_t c = 0; c < channels; c++)
        p.channel[c] = TAKE(a, uint8_t, VIEW_PIXELS);
    return p;
}

bool view_follow(view_map *map, const float uv[2], float tall)
{
    float const slack = 10.0f; /* working pixels that the person may drift before the region moves */
    float const want = f_clamp((float)VIEW_PERSON / f_max(tall, 1.0f), 1.0f / 32.0f, 2.0f);
    float const half = 0.5f * (float)(VIEW_SIZE - 1);
    if (map->scale > 0.0f) {
        float const du = (uv[0] - map->u0) * map->scale - half, dv = (uv[1] - map->v0) * map->scale - half;
        float const ratio = want / map->scale;
        if (du > -slack && du < slack && dv > -slack && dv < slack && ratio > 0.94f && ratio < 1.06f)
            return false;
    }
    map->scale = want;
    map->u0 = uv[0] - half / want;
    map->v0 = uv[1] - half / want;
    return true;
}

void view_sample(const kernels *run, const view_map *map, const gait_camera *cam, const gait_image *im,
                 view_planes *out)
{
    out->channels = image_channels(im->format);
    run->view_rows(map, cam, im, 0, VIEW_SIZE, out);
}
