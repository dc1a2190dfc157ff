/* instructions.c - some steps of the default tracker on a drawn person, for a program that counts instructions. */
#include "bench_scene.h"
#include "trackd/common.h"
#include "gait.h"

#include <stdio.h>
#include <stdlib.h>

enum { FRAMES = 3 };

static void *memory_of(size_t bytes)
{
    return aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
}

static gait_result steps(const gait_model *model, int32_t particles, gait_error *err)
{
    static bench_scene scene;
    message why = {""};
    gait_tracker_config cfg;
    gait_tracker *t = NULL;
    gait_estimate estimate;
    gait_state const sd = bench_scene_start_sd(0.05f);
    size_t bytes = 0;
    if (!bench_scene_make(&scene, model, 640, 480, FRAMES, &why))
        return GAIT_ERR_ARG;
    gait_image const plate = bench_scene_plate(&scene);
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    cfg.particles = particles;
    cfg.camera[0] = scene.camera;
    gait_result done = gait_tracker_bytes(model, &cfg, &bytes, err);
    if (done == GAIT_OK)
        done = gait_tracker_init(memory_of(bytes), bytes, model, &cfg, &t, err);
    if (done == GAIT_OK)
        done = gait_tracker_set_background(t, 0, &plate, err);
    if (done == GAIT_OK)
        done = gait_tracker_start(t, &scene.start, &sd, 0, err);
    for (int32_t f = 0; done == GAIT_OK && f < FRAMES; f++) {
        gait_frame const frame = {.utime = (int64_t)f * 1000000 / 30,
                                  .image = {bench_scene_frame(&scene, f)}};
        done = gait_tracker_step(t, &frame, &estimate, err);
    }
    return done;
}

int main(int argc, char **argv)
{
    message why = {""};
    file_bytes blob;
    gait_model *model = NULL;
    gait_error err = {.text = ""};
    size_t bytes = 0;
    if (argc != 3 || !file_read(argv[1], "model", FILE_MOST, &blob, &why)) {
        fprintf(stderr, "usage: instructions MODEL PARTICLES %s\n", why.text);
        return 2;
    }
    gait_result done = gait_model_bytes(blob.data, blob.size, &bytes, &err);
    if (done == GAIT_OK)
        done = gait_model_init(memory_of(bytes), bytes, blob.data, blob.size, &model, &err);
    if (done == GAIT_OK)
        done = steps(model, (int32_t)strtol(argv[2], NULL, 10), &err);
    if (done != GAIT_OK)
        fprintf(stderr, "instructions: %s: %s\n", gait_result_name(done), err.text);
    return done != GAIT_OK;
}
