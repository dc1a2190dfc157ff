/* toy_start.h - an automatic start for the toy person, with a level camera 1.5 m over the floor. */
#ifndef TOY_START_H
#define TOY_START_H
#include "check.h"
#include "gait_start.h"
#include "base/hash.h"
#include "golden.h"
#include "toy_model.h"

#include <stddef.h>
#include <stdlib.h>

/* A level camera that looks along +y. */
static gait_camera level_camera(int32_t width, int32_t height, float f)
{
    return (gait_camera){.width = width,
                         .height = height,
                         .fx = f,
                         .fy = f,
                         .cx = 0.5f * (float)(width - 1),
                         .cy = 0.5f * (float)(height - 1),
                         .R = {1, 0, 0, 0, 0, -1, 0, 1, 0},
                         .t = {0.0f, 1.5f, 0.0f}};
}

static gait_start *toy_start_of(const gait_model *model, gait_camera camera, uint32_t cpu_mask)
{
    gait_start_config cfg;
    gait_start *s = NULL;
    size_t bytes = 0;
    gait_start_default(&cfg);
    cfg.camera = camera;
    cfg.cpu_mask = cpu_mask;
    CHECK(gait_start_bytes(model, &cfg, &bytes, NULL) == GAIT_OK);
    void *const mem = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
    CHECK(gait_start_init(mem, bytes, model, &cfg, &s, NULL) == GAIT_OK);
    return s; /* at the beginning of mem */
}

static inline gait_start *toy_start_new(gait_camera camera, uint32_t cpu_mask)
{
    return toy_start_of(toy_model(), camera, cpu_mask);
}

/* Hash of all hypotheses without their classes of motion, which are 0. */
static inline uint64_t toy_hash_hypotheses(const gait_hypothesis h[GAIT_START_MAX_HYPOTHESES])
{
    size_t const state = offsetof(gait_state, motion_class);
    uint64_t hash = HASH_INIT;
    for (int k = 0; k < GAIT_START_MAX_HYPOTHESES; k++) {
        CHECK(h[k].mean.motion_class == 0 && h[k].sd.motion_class == 0);
        hash = hash_fnv1a(hash, &h[k].mean, state);
        hash = hash_fnv1a(hash, &h[k].sd, state);
        size_t const rest = offsetof(gait_hypothesis, correlation);
        hash = hash_fnv1a(hash, (const char *)&h[k] + rest, sizeof *h - rest);
    }
    return hash;
}
#endif
