/* toy_films.h - films that together exercise everything a tracker does.
 *
 *   gait_tracker_config cfg = films_config(FILMS_GIVEN);
 *   films_start(t, &cfg, n, factor);                  with backgrounds; acquisition always starts at frame 0
 *   gait_frame f = films_frame(&cfg, n, missing);     without the cameras in `missing` (bits); valid until the next
 *
 * Call film_make() first. */
#ifndef TOY_FILMS_H
#define TOY_FILMS_H
#include "toy_film.h"

enum {
    FILMS_USUAL,
    FILMS_PAPER,  /* texture alone, a multinomial draw at every frame, random walks */
    FILMS_GIVEN,  /* all that a frame may contain: colours, lens distortion, keypoints */
    FILMS_SEARCH, /* the phase is unknown: acquisition, two hypotheses, a decision */
    FILMS
};

static inline void films_paper(gait_tracker_config *cfg)
{
    cfg->mode = GAIT_MODE_PAPER;
    cfg->terms = GAIT_TERM_TEXTURE;
    cfg->resample_ess = 1.0f;
    cfg->evidence_time = cfg->rejuvenation_time = cfg->tilt_time = cfg->coef_time = cfg->rate_time = 0.0f;
    cfg->offset_angles = 0;
}

static inline void films_given(gait_tracker_config *cfg)
{
    static const float lens[5] = {-0.11f, 0.03f, 0.002f, -0.001f, 0.004f};
    cfg->terms |= GAIT_TERM_KEYPOINTS;
    for (int k = 0; k < cfg->cameras; k++)
        memcpy(cfg->camera[k].distortion, lens, sizeof lens);
}

static inline gait_tracker_config films_config(int film_kind)
{
    gait_tracker_config cfg = toy_config(SCENE_CAMERAS);
    cfg.particles = 100; /* not a multiple of a block */
    cfg.offset_angles = TOY_TRUNK;
    if (film_kind == FILMS_PAPER)
        films_paper(&cfg);
    else if (film_kind == FILMS_GIVEN)
        films_given(&cfg);
    else if (film_kind == FILMS_SEARCH)
        cfg.acquisition_particles = 2 * cfg.particles;
    return cfg;
}

/* Whether a config is that of FILMS_GIVEN: a few settings determine the film, and tests can change the others. */
static inline bool films_is_given(const gait_tracker_config *cfg)
{
    return cfg->terms & GAIT_TERM_KEYPOINTS;
}

static inline gait_image films_coloured(const uint8_t *grey, int k, uint8_t *pixels)
{
    for (int32_t i = 0; i < SCENE_PIXELS; i++) {
        uint8_t *const p = pixels + 3 * (ptrdiff_t)i;
        p[0] = grey[i];
        p[1] = (uint8_t)(20 + grey[i] * 3 / 4);
        p[2] = (uint8_t)(60 + grey[i] * 5 / 8 + i % 7);
    }
    return (gait_image){.data = pixels,
                        .width = SCENE_W,
                        .height = SCENE_H,
                        .stride = 3 * SCENE_W,
                        .format = k ? GAIT_RGB8 : GAIT_BGR8};
}

/* The empty scene, in memory that stays valid, since trackers borrow it. */
static inline gait_image films_wall(const gait_tracker_config *cfg, int k)
{
    static uint8_t wall[SCENE_CAMERAS][3 * SCENE_PIXELS];
    return films_is_given(cfg) ? films_coloured(film_wall[k], k, wall[k]) : toy_image(film_wall[k]);
}

/* Joints of frame n, with errors of up to 2 pixels, some of them unobserved. */
static inline void films_detect(const gait_camera *cam, int n, gait_keypoint *out)
{
    gait_state const truth = toy_walk((float)n / 30.0f);
    gait_pose pose;
    gait_model_info info;
    if (gait_model_pose(toy_model(), &truth, &pose, NULL) != GAIT_OK ||
        gait_model_get_info(toy_model(), &info, NULL) != GAIT_OK)
        abort();
    for (int32_t j = 0; j < info.joints; j++) {
        uint32_t const chance = toy_hash((uint32_t)n, (uint32_t)j, 91);
        float uv[2] = {0}, u, v;
        camera_project(cam, pose.joint[j], uv);
        camera_distort(cam, uv[0], uv[1], &u, &v);
        out[j] = (gait_keypoint){.u = u + (float)(chance % 5) - 2.0f,
                                 .v = v + (float)(chance / 5 % 5) - 2.0f,
                                 .sd = chance % 11 ? 2.0f : 0.0f};
    }
}

static inline gait_frame films_frame(const gait_tracker_config *cfg, int n, uint32_t missing)
{
    static uint8_t shot[SCENE_CAMERAS][3 * SCENE_PIXELS];
    static gait_keypoint track[SCENE_CAMERAS][GAIT_MAX_JOINTS];
    gait_frame f = toy_frame(n);
    for (int k = 0; k < cfg->cameras; k++) {
        if (films_is_given(cfg) && n % 5 != 2) {
            films_detect(&cfg->camera[k], n, track[k]);
            f.keypoints[k] = track[k];
        }
        if (!(missing >> k & 1u))
            f.image[k] = films_is_given(cfg) ? films_coloured(film[k][n], k, shot[k]) : toy_image(film[k][n]);
    }
    return f;
}

static inline void films_start(gait_tracker *t, const gait_tracker_config *cfg, int n, float factor)
{
    for (int k = 0; k < cfg->cameras; k++) {
        gait_image const plate = films_wall(cfg, k);
        if (gait_tracker_set_background(t, k, &plate, NULL) != GAIT_OK)
            abort();
    }
    if (cfg->acquisition_particles > 0)
        toy_tracker_start_uncertain(t, 0.5f);
    else
        toy_tracker_start(t, n, factor);
}
#endif
