/* bench_scene.h - a drawn person who crosses a textured scene, in colour, at the same size in images of any size. */
#ifndef BENCH_SCENE_H
#define BENCH_SCENE_H
#include "trackd/common.h"
#include "gait.h"

typedef struct bench_scene {
    gait_camera camera;
    gait_state start;
    int32_t frames;
    uint8_t *plate, *pixels; /* BGR: empty scene; frames */
} bench_scene;

/* Standard deviations with which tracking begins. */
static inline gait_state bench_scene_start_sd(float phase)
{
    return (gait_state){.phase = phase,
                        .stride_hz = 0.05f,
                        .stature = 0.03f,
                        .heading = 0.1f,
                        .pelvis = {0.05f, 0.05f, 0.02f},
                        .pitch = 0.02f,
                        .roll = 0.02f};
}

bool bench_scene_make(bench_scene *s, const gait_model *model, int32_t width, int32_t height, int32_t frames,
                      message *why);
void bench_scene_free(bench_scene *s);
gait_image bench_scene_plate(const bench_scene *s);
gait_image bench_scene_frame(const bench_scene *s, int32_t frame);
#endif
