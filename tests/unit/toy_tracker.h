/* toy_tracker.h - trackers of the toy person for tests, with settings that do not follow the library's defaults.
 *
 *   gait_tracker_config cfg = toy_config(1);         300 particles, all terms; change what the test needs
 *   gait_tracker *t = toy_tracker_new(&cfg);         in exactly the memory it asks for; stops the test on failure
 *   toy_tracker_start(t, n, 0.5f);                   near the truth of frame n, with half the usual spread
 *   toy_tracker_start_uncertain(t, 0.5f);                      at frame 0, with this standard deviation of the phase
 *   toy_tracker_step(t, n, shots, &e);               frame n of the scene; shots[camera] NULL: missed
 *   toy_tracker_free(t); */
#ifndef TOY_TRACKER_H
#define TOY_TRACKER_H
#include "toy_scene.h"

static inline gait_tracker_config toy_config(int32_t cameras)
{
    gait_tracker_config c;
    gait_tracker_default(&c, GAIT_MODE_DEFAULT);
    c.seed = 7;
    c.particles = 300;
    c.acquisition_particles = 0;
    c.components = TOY_COMPONENTS;
    c.tasks = 4;
    c.cameras = cameras;
    c.lag = 5;
    c.terms = GAIT_TERM_TEXTURE | GAIT_TERM_SILHOUETTE | GAIT_TERM_EDGES | GAIT_TERM_TEMPLATE;
    c.texture_weight = 0.2f;
    c.silhouette_weight = 25.0f;
    c.edges_weight = 40.0f;
    c.template_weight = 4.0f;
    c.missed_weight = 0.4f;
    c.girth = 1.0f;
    c.resample_ess = 0.5f;
    c.evidence_time = 0.13f;
    c.rejuvenation_time = 0.7f;
    c.max_dt = 0.5f;
    c.phase_noise = 0.0164f;
    c.rate_noise = 0.02f;
    c.settle_time = 1.0f;
    c.rate_time = 5.0f;
    c.forward_noise = 0.022f;
    c.lateral_noise = 0.0164f;
    c.vertical_noise = 0.0096f;
    c.heading_noise = 0.044f;
    c.tilt_noise = 0.033f;
    c.tilt_time = 1.1f;
    c.coef_noise = 0.66f;
    c.coef_time = 4.5f;
    c.stature_noise = 0.02f;
    c.stature_noise_start = 0.2f;
    c.offset_noise = 0.4f;
    c.offset_angles = 0;
    c.proportions = -1; /* so that they are tested */
    c.joint_sd_model = 0.0f;
    c.occluded_density = 0.0018f;
    c.surface_sd = 8.0f;
    c.surface_tilt = 1.0f;
    c.limb_points = 16;
    c.stayed_nats = 10.0f;
    c.coef_start = 1.0f;
    for (int k = 0; k < GAIT_MAX_CAMERAS; k++)
        c.camera[k] = toy_camera(k);
    return c;
}

static inline void toy_stop(const char *what, const gait_error *err)
{
    fprintf(stderr, "toy tracker: %s refused: %s\n", what, err->text);
    abort();
}

static inline gait_tracker *toy_tracker_of(const gait_model *m, const gait_tracker_config *cfg)
{
    size_t bytes = 0;
    void *memory = NULL;
    gait_tracker *t = NULL;
    gait_error err = {0};
    if (gait_tracker_bytes(m, cfg, &bytes, &err) != GAIT_OK)
        toy_stop("configuration", &err);
    if (posix_memalign(&memory, GAIT_ALIGN, bytes))
        abort();
    if (gait_tracker_init(memory, bytes, m, cfg, &t, &err) != GAIT_OK || (void *)t != memory)
        toy_stop("memory", &err);
    return t;
}

static inline gait_tracker *toy_tracker_new(const gait_tracker_config *cfg)
{
    return toy_tracker_of(toy_model(), cfg);
}

static inline void toy_tracker_free(gait_tracker *t)
{
    free(t); /* a tracker is at the start of its memory */
}

/* Standard deviations of a start by hand, times `factor`. */
static inline gait_state toy_start_sd(float factor)
{
    gait_state sd = {.phase = 0.04f * factor,
                     .stride_hz = 0.05f * factor,
                     .stature = 0.02f * factor,
                     .heading = 0.08f * factor,
                     .pitch = 0.02f * factor,
                     .roll = 0.02f * factor,
                     .pelvis = {0.05f * factor, 0.05f * factor, 0.03f * factor}};
    for (int k = 0; k < TOY_COMPONENTS; k++)
        sd.coef[k] = 0.5f * factor;
    return sd;
}

static inline void toy_tracker_begin(gait_tracker *t, int n, const gait_state *sd)
{
    gait_state const mean = toy_walk((float)n / 30.0f);
    gait_error err = {0};
    if (gait_tracker_start(t, &mean, sd, toy_frame(n).utime, &err) != GAIT_OK)
        toy_stop("start", &err);
}

static inline void toy_tracker_start(gait_tracker *t, int n, float factor)
{
    gait_state const sd = toy_start_sd(factor);
    toy_tracker_begin(t, n, &sd);
}

static inline void toy_tracker_start_uncertain(gait_tracker *t, float phase_sd)
{
    gait_state sd = toy_start_sd(1.0f);
    sd.phase = phase_sd;
    toy_tracker_begin(t, 0, &sd);
}

static inline void toy_tracker_step(gait_tracker *t, int n, const uint8_t *const shots[SCENE_CAMERAS],
                                    gait_estimate *out)
{
    gait_frame f = toy_frame(n);
    gait_error err = {0};
    for (int k = 0; k < SCENE_CAMERAS; k++)
        if (shots[k])
            f.image[k] = toy_image(shots[k]);
    if (gait_tracker_step(t, &f, out, &err) != GAIT_OK)
        toy_stop("frame", &err);
}
#endif
