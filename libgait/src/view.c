#include "view.h"
#include "base.h"
#include "camera.h"
#include "rast.h"

enum { FRACTION = 256 }; /* fixed-point steps of a source pixel */

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

/* Source positions of row j of the working image in 1/FRACTION pixels of the captured frame. */
static void source_row(const view_map *map, const gait_camera *cam, int32_t j, int32_t *su, int32_t *sv)
{
    float const inv = 1.0f / map->scale, limit = 30000.0f;
    bool const bent = camera_distorted(cam);
    float const v = map->v0 + (float)j * inv;
    for (int32_t i = 0; i < VIEW_SIZE; i++) {
        float u = map->u0 + (float)i * inv, w = v;
        if (bent)
            camera_distort(cam, u, v, &u, &w);
        su[i] = (int32_t)(f_clamp(u, -limit, limit) * (float)FRACTION);
        sv[i] = (int32_t)(f_clamp(w, -limit, limit) * (float)FRACTION);
    }
}

/* Side of the box of source pixels that one working pixel averages. */
static int32_t box_side(const view_map *map)
{
    return i_clamp((int32_t)(1.0f / map->scale), 1, 16);
}

static uint8_t tap_bilinear(const gait_image *im, int32_t step, int32_t c, int32_t su, int32_t sv)
{
    int32_t const u = i_clamp(su, 0, (im->width - 1) * FRACTION),
                  v = i_clamp(sv, 0, (im->height - 1) * FRACTION);
    int32_t const x = u >> 8, y = v >> 8, fx = u & 255, fy = v & 255;
    int32_t const right = x + 1 < im->width ? step : 0;
    const uint8_t *const p = im->data + (size_t)y * (size_t)im->stride + (size_t)(x * step + c);
    const uint8_t *const q = p + (y + 1 < im->height ? im->stride : 0);
    int32_t const top = p[0] * (FRACTION - fx) + p[right] * fx, low = q[0] * (FRACTION - fx) + q[right] * fx;
    return (uint8_t)((top * (FRACTION - fy) + low * fy + (1 << 15)) >> 16);
}

static uint8_t tap_box(const gait_image *im, int32_t step, int32_t c, int32_t su, int32_t sv, int32_t side)
{
    int32_t const offset = FRACTION / 2 - (side - 1) * FRACTION / 2;
    int32_t const x = i_clamp((su + offset) >> 8, 0, i_max(im->width - side, 0));
    int32_t const y = i_clamp((sv + offset) >> 8, 0, i_max(im->height - side, 0));
    int32_t const nx = i_min(side, im->width), ny = i_min(side, im->height);
    int32_t sum = 0;
    for (int32_t j = 0; j < ny; j++) {
        const uint8_t *const row = im->data + (size_t)(y + j) * (size_t)im->stride + (size_t)(x * step + c);
        for (int32_t i = 0; i < nx; i++)
            sum += row[i * step];
    }
    return (uint8_t)((sum + nx * ny / 2) / (nx * ny));
}

void view_sample(const view_map *map, const gait_camera *cam, const gait_image *im, view_planes *out)
{
    int32_t const step = im->format == GAIT_GREY8 ? 1 : 3, side = box_side(map);
    int32_t su[VIEW_SIZE], sv[VIEW_SIZE];
    out->channels = step;
    for (int32_t j = 0; j < VIEW_SIZE; j++) {
        source_row(map, cam, j, su, sv);
        for (int32_t c = 0; c < step; c++) {
            /* Planes are R, G, B whatever the order in the frame. */
            int32_t const from = im->format == GAIT_BGR8 ? 2 - c : c;
            uint8_t *const row = out->channel[c] + j * VIEW_SIZE;
            if (side == 1)
                for (int32_t i = 0; i < VIEW_SIZE; i++)
                    row[i] = tap_bilinear(im, step, from, su[i], sv[i]);
            else
                for (int32_t i = 0; i < VIEW_SIZE; i++)
                    row[i] = tap_box(im, step, from, su[i], sv[i], side);
        }
    }
}

void view_inside(const view_map *map, const gait_camera *cam, uint64_t (*inside)[2])
{
    int32_t su[VIEW_SIZE], sv[VIEW_SIZE];
    int32_t const right = (cam->width - 1) * FRACTION, low = (cam->height - 1) * FRACTION;
    for (int32_t y = 0; y < RAST_SIZE; y++) {
        source_row(map, cam, 2 * y, su, sv);
        inside[y][0] = inside[y][1] = 0;
        for (int32_t x = 0; x < RAST_SIZE; x++) {
            int32_t const u = su[2 * x], v = sv[2 * x];
            uint64_t const bit = u >= 0 && u <= right && v >= 0 && v <= low;
            inside[y][x >> 6] |= bit << (x & 63);
        }
    }
}

void view_grey(const view_planes *in, uint8_t *grey)
{
    const uint8_t *const r = in->channel[0], *const g = in->channel[1], *const b = in->channel[2];
    for (int32_t i = 0; i < VIEW_PIXELS; i++)
        grey[i] = in->channels == 1 ? r[i] : (uint8_t)((77 * r[i] + 150 * g[i] + 29 * b[i] + 128) >> 8);
}
