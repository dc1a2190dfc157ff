/* tracker_api.c - public functions of the tracker: check the arguments, then call down. */
#include "api/check.h"
#include "api/kernels.h"
#include "base/cpu.h"
#include "image/image.h"
#include "likelihood/likelihood.h"
#include "tracker/fixed_lag.h"
#include "tracker/snapshot.h"
#include "tracker/tracker.h"
#include <stddef.h>
#include <string.h>

void gait_tracker_default(gait_tracker_config *cfg, int32_t mode)
{
    bool const paper = mode == GAIT_MODE_PAPER;
    if (!cfg)
        return;
    *cfg = (gait_tracker_config){
        .struct_size = sizeof *cfg,
        .mode = mode,
        .seed = 1,
        .particles = paper ? 10000 : 2000,
        .acquisition_particles = paper ? 0 : 4000,
        .components = -1,
        .proportions = 0,
        .tasks = 8,
        .cameras = 1,
        .lag = 5,
        .terms = paper ? GAIT_TERM_TEXTURE
                       : GAIT_TERM_TEXTURE | GAIT_TERM_SILHOUETTE | GAIT_TERM_EDGES | GAIT_TERM_TEMPLATE,
        .term_weight = {[LIKE_TEXTURE] = 0.2f,
                        [LIKE_SILHOUETTE] = 25.0f,
                        [LIKE_EDGES] = 40.0f,
                        [LIKE_TEMPLATE] = 4.0f,
                        [LIKE_KEYPOINTS] = 8.0f},
        .missed_weight = 0.6f,
        .girth = 1.0f,
        .resample_ess = paper ? 1.0f : 0.5f,
        .evidence_time = paper ? 0.0f : 0.1f,
        .rejuvenation_time = paper ? 0.0f : 1.5f,
        .max_dt = 0.5f,
        .phase_noise = 0.0164f,
        .rate_noise = 0.055f,
        .settle_time = 1.0f,
        .rate_time = 3.0f,
        .forward_noise = 0.08f,
        .lateral_noise = 0.02f,
        .vertical_noise = 0.0096f,
        .heading_noise = 0.044f,
        .turn_sd = 0.5f,
        .turn_time = 6.0f,
        .tilt_noise = 0.033f,
        .tilt_time = 1.1f,
        .coef_noise = 0.667f, /* with coef_time: the population's unit variance */
        .coef_time = 4.5f,
        .stature_noise = 0.2f,
        .stature_noise_start = 2.0f,
        .proportion_noise = 0.15f,
        .joint_sd_model = 0.015f,
        .offset_noise = 0.58f,
        .offset_angles = -1,
        .cpu_mask = ~0u,
    };
    if (paper) { /* random walks of Ormoneit et al. 2000, eqs. 5-9, who leave the rates open */
        cfg->phase_noise = 0.022f;
        cfg->rate_noise = 0.055f;
        cfg->forward_noise = cfg->lateral_noise = 0.044f;
        cfg->vertical_noise = 0.022f;
        cfg->heading_noise = 0.11f;
        cfg->turn_sd = cfg->turn_time = 0.0f;
        cfg->tilt_noise = 0.055f;
        cfg->coef_noise = 0.5f;
        cfg->tilt_time = cfg->coef_time = cfg->rate_time = 0.0f;
        cfg->stature_noise = cfg->stature_noise_start = 0.0f;
        cfg->offset_angles = 0;
        cfg->joint_sd_model = 0.0f;
        cfg->term_weight[LIKE_TEXTURE] = 1.0f;
    }
}

typedef struct range { /* one float of a struct, or `count` of them */
    char name[20];
    uint16_t offset, count;
    float low, high;
} range;

#define RANGE(member, low, high)        {#member, offsetof(gait_tracker_config, member), 1, low, high}
#define STATE(member, count, low, high) {#member, offsetof(gait_state, member), count, low, high}
#define MOST_SD                         10.0f /* of any number of a start */

/* Every number of a struct is in its range; of deviations [0, MOST_SD]. */
static gait_result check_ranges(const range *ranges, size_t count, const void *of, const char *what, bool sds,
                                gait_error *err)
{
    for (size_t k = 0; k < count; k++)
        for (int32_t i = 0; i < ranges[k].count; i++) {
            float const low = sds ? 0.0f : ranges[k].low, high = sds ? MOST_SD : ranges[k].high;
            float v;
            memcpy(&v, (const char *)of + ranges[k].offset + (size_t)i * sizeof v, sizeof v);
            if (!(v >= low && v <= high)) /* also false for NaN */
                return base_fail(err, GAIT_ERR_ARG, (int)k, "%s%s = %g is outside [%g, %g]", what,
                                 ranges[k].name, (double)v, (double)low, (double)high);
        }
    return GAIT_OK;
}

static gait_result check_numbers(const gait_tracker_config *cfg, gait_error *err)
{
    static const range RANGES[] = {
        RANGE(term_weight[0], 0.0f, 1e6f),
        RANGE(term_weight[1], 0.0f, 1e6f),
        RANGE(term_weight[2], 0.0f, 1e6f),
        RANGE(term_weight[3], 0.0f, 1e6f),
        RANGE(term_weight[4], 0.0f, 1e6f),
        RANGE(missed_weight, 0.0f, 1.0f),
        RANGE(girth, 0.5f, 2.0f),
        RANGE(resample_ess, 0.0f, 1.0f),
        RANGE(evidence_time, 0.0f, 1e6f),
        RANGE(rejuvenation_time, 0.0f, 1e6f),
        RANGE(max_dt, 1e-3f, 10.0f),
        RANGE(phase_noise, 0.0f, 10.0f),
        RANGE(rate_noise, 0.0f, 10.0f),
        RANGE(settle_time, 0.0f, 1e6f),
        RANGE(rate_time, 0.0f, 1e6f),
        RANGE(forward_noise, 0.0f, 100.0f),
        RANGE(lateral_noise, 0.0f, 100.0f),
        RANGE(vertical_noise, 0.0f, 100.0f),
        RANGE(heading_noise, 0.0f, 100.0f),
        RANGE(turn_sd, 0.0f, 100.0f),
        RANGE(turn_time, 0.0f, 1e6f),
        RANGE(tilt_noise, 0.0f, 100.0f),
        RANGE(tilt_time, 0.0f, 1e6f),
        RANGE(coef_noise, 0.0f, 100.0f),
        RANGE(coef_time, 0.0f, 1e6f),
        RANGE(stature_noise, 0.0f, 100.0f),
        RANGE(stature_noise_start, 0.0f, 100.0f),
        RANGE(offset_noise, 0.0f, 100.0f),
        RANGE(proportion_noise, 0.0f, 100.0f),
        RANGE(joint_sd_model, 0.0f, 1.0f),
    };
    return check_ranges(RANGES, sizeof RANGES / sizeof *RANGES, cfg, "config ", false, err);
}

static gait_result check_config(const gait_model *m, const gait_tracker_config *cfg, gait_error *err)
{
    uint32_t const known =
        GAIT_TERM_TEXTURE | GAIT_TERM_SILHOUETTE | GAIT_TERM_EDGES | GAIT_TERM_TEMPLATE | GAIT_TERM_KEYPOINTS;
    if (!m || !cfg)
        return base_fail(err, GAIT_ERR_ARG, -1, "model or config is NULL");
    if (!m->cyclic)
        return model_need_cyclic(m, err);
    if (cfg->struct_size != sizeof *cfg)
        return base_fail(err, GAIT_ERR_STRUCT, -1, "config not filled by gait_tracker_default()");
    if (cfg->mode != GAIT_MODE_DEFAULT && cfg->mode != GAIT_MODE_PAPER)
        return base_fail(err, GAIT_ERR_ARG, -1, "config mode %d is not a GAIT_MODE_*", (int)cfg->mode);
    if (cfg->particles < 16 || cfg->particles > 1 << 20)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "config particles = %d is outside [16, 1048576]",
                         (int)cfg->particles);
    if (cfg->acquisition_particles < 0 || cfg->acquisition_particles > 1 << 20)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "config acquisition_particles = %d is outside [0, 1048576]",
                         (int)cfg->acquisition_particles);
    if (cfg->components < -1 || cfg->components > m->components)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "config components = %d, the model has %d",
                         (int)cfg->components, (int)m->components);
    if (cfg->proportions < -1 || cfg->proportions > m->proportions)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "config proportions = %d, the model has %d",
                         (int)cfg->proportions, (int)m->proportions);
    if (cfg->tasks < 1 || cfg->tasks > TASK_MOST)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "config tasks = %d is outside [1, %d]", (int)cfg->tasks,
                         TASK_MOST);
    if (cfg->cameras < 1 || cfg->cameras > GAIT_MAX_CAMERAS)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "config cameras = %d is outside [1, %d]", (int)cfg->cameras,
                         GAIT_MAX_CAMERAS);
    if (cfg->lag < 0 || cfg->lag > 64)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "config lag = %d is outside [0, 64]", (int)cfg->lag);
    if (cfg->terms == 0 || (cfg->terms & ~known) != 0)
        return base_fail(err, GAIT_ERR_ARG, -1, "config terms = 0x%x is not a set of GAIT_TERM_*",
                         (unsigned)cfg->terms);
    if (cfg->offset_angles < -1 || cfg->offset_angles > UINT32_MAX)
        return base_fail(err, GAIT_ERR_ARG, -1,
                         "config offset_angles = %lld is neither -1 nor a mask of angles",
                         (long long)cfg->offset_angles);
    if (!cpu_mask_valid(cfg->cpu_mask))
        return base_fail(err, GAIT_ERR_ARG, -1, "config cpu_mask = 0x%x is not ~0u or a set of GAIT_CPU_*",
                         (unsigned)cfg->cpu_mask);
    for (int32_t c = 0; c < cfg->cameras; c++) {
        gait_result const s = check_camera(&cfg->camera[c], c, err);
        if (s != GAIT_OK)
            return s;
    }
    return check_numbers(cfg, err);
}

gait_result gait_tracker_bytes(const gait_model *m, const gait_tracker_config *cfg, size_t *bytes,
                               gait_error *err)
{
    gait_result const s = check_config(m, cfg, err);
    arena a = {.cap = SIZE_MAX};
    if (s != GAIT_OK)
        return s;
    if (!bytes)
        return base_fail(err, GAIT_ERR_ARG, -1, "bytes is NULL");
    tracker_layout(&a, m, cfg, kernels_choose(cfg->cpu_mask));
    if (a.overflow)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "the tracker would need more memory than can be addressed");
    *bytes = a.used;
    return GAIT_OK;
}

gait_result gait_tracker_init(void *mem, size_t mem_bytes, const gait_model *m,
                              const gait_tracker_config *cfg, gait_tracker **out, gait_error *err)
{
    if (!mem || !out)
        return base_fail(err, GAIT_ERR_ARG, -1, "mem or out is NULL");
    arena a = {.base = NULL};
    gait_result s = gait_tracker_bytes(m, cfg, &a.used, err);
    if (s == GAIT_OK)
        s = arena_place(&a, mem, mem_bytes, err);
    if (s != GAIT_OK)
        return s;
    gait_tracker *const t = tracker_layout(&a, m, cfg, kernels_choose(cfg->cpu_mask));
    tracker_clear(t);
    *out = t;
    return GAIT_OK;
}

/* Pixels as the camera gives them. */
static gait_result check_image(const gait_tracker *t, int32_t camera, const gait_image *im, const char *what,
                               gait_error *err)
{
    const gait_camera *const cam = &t->cfg.camera[camera];
    if (!image_channels(im->format))
        return base_fail(err, GAIT_ERR_ARG, camera, "%s of camera %d has unknown format %d", what,
                         (int)camera, (int)im->format);
    if (im->width != cam->width || im->height != cam->height)
        return base_fail(err, GAIT_ERR_ARG, camera, "%s of camera %d is %d x %d, the camera is %d x %d", what,
                         (int)camera, (int)im->width, (int)im->height, (int)cam->width, (int)cam->height);
    int64_t const least = (int64_t)cam->width * image_channels(im->format);
    if (im->stride < least)
        return base_fail(err, GAIT_ERR_ARG, camera,
                         "%s of camera %d has stride %d, %d pixels of %s take at least %lld", what,
                         (int)camera, (int)im->stride, (int)cam->width,
                         least == cam->width ? "GAIT_GREY8" : "GAIT_RGB8 or GAIT_BGR8", (long long)least);
    return GAIT_OK;
}

gait_result gait_tracker_set_background(gait_tracker *t, int32_t camera, const gait_image *plate,
                                        gait_error *err)
{
    if (!t)
        return base_null(err, "gait_tracker_set_background");
    if (camera < 0 || camera >= t->cfg.cameras)
        return base_fail(err, GAIT_ERR_ARG, camera, "background: camera %d is outside [0, %d]", (int)camera,
                         (int)t->cfg.cameras - 1);
    gait_result const s = plate && plate->data ? check_image(t, camera, plate, "background", err) : GAIT_OK;
    if (s != GAIT_OK)
        return s;
    t->camera[camera].background = plate ? *plate : (gait_image){0};
    t->camera[camera].plate_stale = true;
    return GAIT_OK;
}

gait_result gait_tracker_prior(const gait_model *m, gait_state *mean, gait_state *sd, gait_error *err)
{
    if (!m || !mean || !sd)
        return base_null(err, "gait_tracker_prior");
    gait_result const fault = model_need_cyclic(m, err);
    if (fault != GAIT_OK)
        return fault;
    *mean = (gait_state){.stride_hz = m->stride_hz, .stature = m->stature_mean};
    *sd = (gait_state){.phase = 0.5f,
                       .stride_hz = m->stride_hz_sd,
                       .stature = m->stature_sd,
                       .heading = PI_F,
                       .pitch = 0.02f,
                       .roll = 0.02f,
                       .pelvis = {1.0f, 1.0f, 0.1f}};
    for (int32_t k = 0; k < m->components; k++)
        sd->coef[k] = 1.0f;
    for (int32_t k = 0; k < m->proportions; k++)
        sd->proportion[k] = 1.0f;
    for (int32_t a = 0; a < m->angles; a++)
        sd->offset[a] = model_posture_sd(m, a);
    return gait_model_pelvis_height(m, mean, &mean->pelvis[2], err);
}

static gait_result check_start(const gait_state *mean, const gait_state *sd, gait_error *err)
{
    static const range RANGES[] = {
        STATE(phase, 1, 0.0f, 1.0f),
        STATE(stride_hz, 1, 0.1f, 4.0f),
        STATE(stature, 1, 0.5f, 2.5f),
        STATE(heading, 1, -7.0f, 7.0f),
        STATE(pitch, 1, -10.0f, 10.0f),
        STATE(roll, 1, -10.0f, 10.0f),
        STATE(turn_rate, 1, -10.0f, 10.0f),
        STATE(pelvis, 3, -1e4f, 1e4f),
        STATE(coef, GAIT_MAX_COMPONENTS, -10.0f, 10.0f),
        STATE(offset, GAIT_MAX_ANGLES, -10.0f, 10.0f),
        STATE(proportion, GAIT_MAX_PROPORTIONS, -10.0f, 10.0f),
    };
    enum { COUNT = sizeof RANGES / sizeof *RANGES };
    gait_result const s = check_ranges(RANGES, COUNT, mean, "start mean.", false, err);
    return s == GAIT_OK ? check_ranges(RANGES, COUNT, sd, "start sd.", true, err) : s;
}

gait_result gait_tracker_start(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime,
                               gait_error *err)
{
    if (!t || !mean || !sd)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker, mean or sd is NULL");
    gait_result const s = check_start(mean, sd, err);
    if (s == GAIT_OK)
        tracker_start(t, mean, sd, utime);
    return s;
}

static gait_result check_frame(const gait_tracker *t, const gait_frame *frame, gait_error *err)
{
    int64_t const before = t->core->utime;
    if (frame->utime < before || (frame->utime == before && t->core->frame > 0))
        return base_fail(err, GAIT_ERR_STATE, -1, "frame is not newer than the one before");
    uint64_t const dt = (uint64_t)frame->utime - (uint64_t)before; /* cannot overflow */
    if ((double)dt > 1e6 * (double)t->cfg.max_dt)
        return base_fail(err, GAIT_ERR_STATE, -1,
                         "%.3f s since the last frame, max_dt is %.3f s: start again", 1e-6 * (double)dt,
                         (double)t->cfg.max_dt);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        gait_result const s =
            frame->image[c].data ? check_image(t, c, &frame->image[c], "image", err) : GAIT_OK;
        if (s != GAIT_OK)
            return s;
    }
    return GAIT_OK;
}

gait_result gait_tracker_step(gait_tracker *t, const gait_frame *frame, gait_estimate *out, gait_error *err)
{
    if (!t || !frame || !out)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker, frame or out is NULL");
    if (!t->core->started)
        return base_fail(err, GAIT_ERR_STATE, -1, "step before start");
    gait_result const s = check_frame(t, frame, err);
    if (s == GAIT_OK)
        tracker_step(t, frame, out);
    return s;
}

gait_result gait_tracker_lagged(gait_tracker *t, int32_t back, gait_estimate *out, gait_error *err)
{
    if (!t || !out)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker or out is NULL");
    if (back < 0 || back > t->cfg.lag || t->cfg.lag == 0)
        return base_fail(err, GAIT_ERR_ARG, -1, "back = %d is outside the config's lag of %d", (int)back,
                         (int)t->cfg.lag);
    if (!t->core->started || back > fixed_lag_reach(t))
        return base_fail(err, GAIT_ERR_STATE, -1, "no frame %d steps ago since the start", (int)back);
    fixed_lag_estimate(t, back, out);
    return GAIT_OK;
}

gait_result gait_tracker_set_particles(gait_tracker *t, int32_t particles, gait_error *err)
{
    if (!t)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker is NULL");
    if (particles < 16 || particles > t->config_particles)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "%d particles are outside [16, %d], the tracker's own",
                         (int)particles, (int)t->config_particles);
    tracker_set_target(t, particles);
    return GAIT_OK;
}

int32_t gait_tracker_particles(const gait_tracker *t, gait_state *s, float *weight, int32_t cap,
                               gait_error *err)
{
    if (!t || (cap > 0 && (!s || !weight)))
        return base_null(err, "gait_tracker_particles");
    if (cap < 0)
        return base_fail(err, GAIT_ERR_ARG, -1, "gait_tracker_particles: cap = %d is negative", (int)cap);
    if (!t->core->started)
        return base_fail(err, GAIT_ERR_STATE, -1, "no particles before gait_tracker_start()");
    for (int32_t i = 0; i < i_min(cap, t->cfg.particles); i++) {
        particle_state const w = particle_get(&t->particles, i);
        s[i] = particle_to_state(&t->layout, &w);
        weight[i] = (float)t->filter.weight[i];
    }
    return t->cfg.particles;
}

uint64_t gait_tracker_digest(const gait_tracker *t)
{
    return t ? snapshot_digest(t) : 0;
}

gait_result gait_tracker_save(const gait_tracker *t, void *mem, size_t cap, size_t *bytes, gait_error *err)
{
    if (!t || !bytes)
        return base_null(err, "gait_tracker_save");
    if (mem && cap < snapshot_bytes(t))
        return base_fail(err, GAIT_ERR_MEMORY, -1, "the snapshot takes %zu bytes, got %zu", snapshot_bytes(t),
                         cap);
    *bytes = snapshot_bytes(t);
    if (mem)
        snapshot_save(t, mem);
    return GAIT_OK;
}

gait_result gait_tracker_restore(gait_tracker *t, const void *mem, size_t bytes, gait_error *err)
{
    if (!t || !mem)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker or snapshot is NULL");
    return snapshot_restore(t, mem, bytes, err);
}
