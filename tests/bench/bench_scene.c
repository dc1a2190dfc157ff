#include "bench_scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const float FPS = 30;

/* A pattern with detail at the scale of some pixels, [0, 255]. */
static unsigned pattern(int32_t x, int32_t y, unsigned seed)
{
    unsigned h = (unsigned)(x / 5) * 73856093u ^ (unsigned)(y / 7) * 19349663u ^ seed * 83492791u;
    h = (h ^ (h >> 13)) * 0x5bd1e995u;
    return h >> 24;
}

static size_t picture_bytes(const gait_camera *c)
{
    return (size_t)c->width * (size_t)c->height * 3;
}

static void draw_plate(bench_scene *s)
{
    uint8_t *p = s->plate;
    for (int32_t y = 0; y < s->camera.height; y++)
        for (int32_t x = 0; x < s->camera.width; x++)
            for (unsigned k = 0; k < 3; k++)
                *p++ = (uint8_t)(64 + pattern(x, y, k) / 2);
}

/* Clothed limbs over the empty scene, each with its own colour and some detail. */
static void draw_frame(const bench_scene *s, const uint8_t *ids, uint8_t *out)
{
    memcpy(out, s->plate, picture_bytes(&s->camera));
    for (int32_t y = 0; y < s->camera.height; y++)
        for (int32_t x = 0; x < s->camera.width; x++, ids++, out += 3)
            for (unsigned k = 0; *ids && k < 3; k++)
                out[k] = (uint8_t)(40 + (13 + 5 * k) * (*ids % 9) + pattern(x, y, *ids + 20 * k) / 16);
}

bool bench_scene_make(bench_scene *s, const gait_model *model, int32_t width, int32_t height, int32_t frames,
                      message *why)
{
    gait_model_info info;
    gait_state particle_state = {.stature = 1.75f};
    /* 8 m to the side of the path, 1.4 m up. */
    *s = (bench_scene){.frames = frames,
                       .camera = {.width = width,
                                  .height = height,
                                  .fx = 800,
                                  .fy = 800,
                                  .cx = 0.5f * (float)width,
                                  .cy = 0.5f * (float)height,
                                  .R = {1, 0, 0, 0, 0, -1, 0, 1, 0},
                                  .t = {0, 1.4f, 8}}};
    size_t const bytes = picture_bytes(&s->camera);
    uint8_t *const ids = malloc(bytes / 3);
    s->plate = malloc(bytes);
    s->pixels = malloc(bytes * (size_t)frames);
    bool ok = ids && s->plate && s->pixels && gait_model_get_info(model, &info, NULL) == GAIT_OK;
    if (!ok)
        message_set(why, "not enough memory for %d frames of %d x %d", (int)frames, (int)width, (int)height);
    else
        draw_plate(s);
    for (int32_t f = 0; ok && f < frames; f++) {
        if (f == 0) {
            particle_state.stride_hz = info.stride_hz;
            particle_state.pelvis[0] =
                -0.5f * (float)frames / FPS * particle_state.stature * info.stride_hz * info.stride_length;
        }
        ok = gait_model_pelvis_height(model, &particle_state, &particle_state.pelvis[2], NULL) == GAIT_OK &&
             gait_render(model, &s->camera, &particle_state, ids, width, NULL) == GAIT_OK;
        if (f == 0)
            s->start = particle_state;
        draw_frame(s, ids, s->pixels + (size_t)f * bytes);
        particle_state.phase = fmodf(particle_state.phase + info.stride_hz / FPS, 1);
        particle_state.pelvis[0] += particle_state.stature * info.stride_hz * info.stride_length / FPS;
    }
    free(ids);
    return ok || message_set(why, "the person cannot be drawn");
}

void bench_scene_free(bench_scene *s)
{
    free(s->plate);
    free(s->pixels);
    *s = (bench_scene){0};
}

static gait_image bgr(const bench_scene *s, const uint8_t *pixels)
{
    return (gait_image){.data = pixels,
                        .width = s->camera.width,
                        .height = s->camera.height,
                        .stride = 3 * s->camera.width,
                        .format = GAIT_BGR8};
}

gait_image bench_scene_plate(const bench_scene *s)
{
    return bgr(s, s->plate);
}

gait_image bench_scene_frame(const bench_scene *s, int32_t frame)
{
    return bgr(s, s->pixels + (size_t)frame * picture_bytes(&s->camera));
}
