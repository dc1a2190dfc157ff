/* toy_film.h - the scene's pictures, drawn once: film_wall[camera], film[camera][frame].  Call film_make() first. */
#ifndef TOY_FILM_H
#define TOY_FILM_H
#include "toy_tracker.h"

enum { FILM_FRAMES = 64 };

static uint8_t film_wall[SCENE_CAMERAS][SCENE_PIXELS], film[SCENE_CAMERAS][FILM_FRAMES][SCENE_PIXELS];

static inline void film_make(int cameras, int frames)
{
    for (int k = 0; k < cameras; k++) {
        toy_wall(k, film_wall[k]);
        for (int n = 0; n < frames; n++)
            toy_shot(k, n, film[k][n]);
    }
}

/* A tracker with this config and the walls as backgrounds, started at frame n. */
static inline gait_tracker *film_tracker(const gait_tracker_config *cfg, int n, float factor)
{
    gait_tracker *const t = toy_tracker_new(cfg);
    for (int k = 0; k < cfg->cameras; k++) {
        gait_image const plate = toy_image(film_wall[k]);
        if (gait_tracker_set_background(t, k, &plate, NULL) != GAIT_OK)
            abort();
    }
    toy_tracker_start(t, n, factor);
    return t;
}

/* A tracker with this config, started at frame 0 with this standard deviation of the phase. */
static inline gait_tracker *film_uncertain(const gait_tracker_config *cfg, float phase_sd)
{
    gait_tracker *const t = film_tracker(cfg, 0, 1.0f);
    toy_tracker_start_uncertain(t, phase_sd);
    return t;
}

/* Step with frame n of all cameras in use except those in `missing` (bits). */
static inline void film_step(gait_tracker *t, int cameras, int n, uint32_t missing, gait_estimate *e)
{
    const uint8_t *shots[SCENE_CAMERAS] = {NULL};
    for (int k = 0; k < cameras; k++)
        shots[k] = missing >> k & 1u ? NULL : film[k][n];
    toy_tracker_step(t, n, shots, e);
}
#endif
