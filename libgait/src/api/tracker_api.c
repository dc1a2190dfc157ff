/* tracker_api.c - public functions of the tracker: check the arguments, then call down. */
#include "api/check.h"
#include "api/fields.h"
#include "api/kernels.h"
#include "base/cpu.h"
#include "likelihood/likelihood.h"
#include "tracker/fixed_lag.h"
#include "tracker/snapshot.h"
#include "tracker/tracker.h"
#include <stddef.h>
#include <string.h>

#define USUAL(meaning, type, name, array, unit, value, low, high)               .name = (type)(value),
#define USUAL_OF_TWO(meaning, type, name, array, unit, value, paper, low, high) .name = (type)(value),
#define SET_PAPER(meaning, type, name, array, unit, value, paper, low, high)    full.name = (type)(paper);
#define NO_DEFAULT(...)

void gait_tracker_fill(gait_tracker_config *cfg, size_t cfg_bytes, gait_mode mode)
{
    static const gait_tracker_config USUALLY = {GAIT_TRACKER_CONFIG_FIELDS(USUAL, USUAL_OF_TWO, NO_DEFAULT)};
    gait_tracker_config full = USUALLY;
    full.mode = mode;
    if (mode == GAIT_MODE_PAPER) {
        GAIT_TRACKER_CONFIG_FIELDS(NO_DEFAULT, SET_PAPER, NO_DEFAULT)
    }
    full.struct_size = cfg_bytes < sizeof full ? cfg_bytes : sizeof full;
    if (cfg)
        memcpy(cfg, &full, (size_t)full.struct_size);
}

/* Check a config, which may come from an older header, and complete it. */
static gait_result open_config(const gait_model *m, const gait_tracker_config *given,
                               gait_tracker_config *cfg, gait_error *err)
{
    uint32_t const known = GAIT_TERMS_DEFAULT | GAIT_TERM_KEYPOINTS;
    if (!m || !given)
        return base_fail(err, GAIT_ERR_ARG, -1, "model or config is NULL");
    gait_result s = model_need_cyclic(m, err);
    if (s == GAIT_OK)
        s = fields_check_size("gait_tracker_config", given->struct_size, "gait_tracker_default", err);
    if (s != GAIT_OK)
        return s;
    gait_tracker_default(cfg, given->mode);
    memcpy(cfg, given, (size_t)given->struct_size);
    cfg->struct_size = sizeof *cfg;
    if (cfg->mode != GAIT_MODE_DEFAULT && cfg->mode != GAIT_MODE_PAPER)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker config: mode = %d is not a GAIT_MODE_*",
                         (int)cfg->mode);
    s = fields_check("gait_tracker_config", cfg, "tracker config: ", err);
    if (s != GAIT_OK)
        return s;
    if (cfg->components > m->components)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "tracker config: components = %d, the model has %d",
                         (int)cfg->components, (int)m->components);
    if (cfg->proportions > m->proportions)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "tracker config: proportions = %d, the model has %d",
                         (int)cfg->proportions, (int)m->proportions);
    if (cfg->terms == 0 || (cfg->terms & ~known) != 0)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker config: terms = 0x%x is not a set of GAIT_TERM_*",
                         (unsigned)cfg->terms);
    if (!cpu_mask_valid(cfg->cpu_mask))
        return base_fail(err, GAIT_ERR_ARG, -1,
                         "tracker config: cpu_mask = 0x%x is not ~0u or a set of GAIT_CPU_*",
                         (unsigned)cfg->cpu_mask);
    for (int32_t c = 0; c < cfg->cameras; c++) {
        s = check_camera(&cfg->camera[c], c, err);
        if (s != GAIT_OK)
            return s;
    }
    return GAIT_OK;
}

/* Bytes of a tracker; GAIT_ERR_LIMIT: more than can be addressed. */
static gait_result count_bytes(const gait_model *m, const gait_tracker_config *cfg, size_t *bytes,
                               gait_error *err)
{
    arena a = {.cap = SIZE_MAX};
    tracker_layout(&a, m, cfg, kernels_choose(cfg->cpu_mask));
    if (a.overflow)
        return base_fail(err, GAIT_ERR_LIMIT, -1, "the tracker would need more memory than can be addressed");
    *bytes = a.used;
    return GAIT_OK;
}

gait_result gait_tracker_bytes(const gait_model *m, const gait_tracker_config *cfg, size_t *bytes,
                               gait_error *err)
{
    gait_tracker_config full;
    if (!bytes)
        return base_null(err, "gait_tracker_bytes");
    gait_result const s = open_config(m, cfg, &full, err);
    return s == GAIT_OK ? count_bytes(m, &full, bytes, err) : s;
}

gait_result gait_tracker_init(void *mem, size_t mem_bytes, const gait_model *m,
                              const gait_tracker_config *cfg, gait_tracker **out, gait_error *err)
{
    gait_tracker_config full;
    arena a = {.base = NULL};
    if (!mem || !out)
        return base_null(err, "gait_tracker_init");
    gait_result s = open_config(m, cfg, &full, err);
    if (s == GAIT_OK)
        s = count_bytes(m, &full, &a.used, err);
    if (s == GAIT_OK)
        s = arena_place(&a, mem, mem_bytes, err);
    if (s != GAIT_OK)
        return s;
    gait_tracker *const t = tracker_layout(&a, m, &full, kernels_choose(full.cpu_mask));
    tracker_clear(t);
    *out = t;
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
    gait_result const s = plate && plate->data
                              ? check_image(&t->cfg.camera[camera], camera, plate, "background", err)
                              : GAIT_OK;
    if (s != GAIT_OK)
        return s;
    t->camera[camera].background = plate ? *plate : (gait_image){0};
    t->camera[camera].plate_stale = true;
    return GAIT_OK;
}

/* Radians per second; half of the people do not turn (dynamics_draw()). */
static const float TURN_SD = 0.25f;

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
                       .pelvis = {1.0f, 1.0f, 0.1f},
                       .turn_rate = TURN_SD};
    for (int32_t k = 0; k < m->components; k++)
        sd->coef[k] = 1.0f;
    for (int32_t k = 0; k < m->proportions; k++)
        sd->proportion[k] = 1.0f;
    for (int32_t a = 0; a < m->angles; a++)
        sd->offset[a] = model_posture_sd(m, a);
    return gait_model_pelvis_height(m, mean, &mean->pelvis[2], err);
}

static gait_result check_start(const gait_model *m, const gait_state *mean, const gait_state *sd,
                               gait_error *err)
{
    gait_result const s = fields_check("gait_state", mean, "start mean.", err);
    if (s == GAIT_OK && mean->motion_class >= m->classes)
        return base_fail(err, GAIT_ERR_ARG, -1, "start mean.motion_class = %d, the model has %d",
                         (int)mean->motion_class, (int)m->classes);
    return s == GAIT_OK ? fields_check_sd("gait_state", sd, MOST_SD, "start sd.", err) : s;
}

gait_result gait_tracker_start(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime,
                               gait_error *err)
{
    if (!t || !mean || !sd)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker, mean or sd is NULL");
    gait_result const s = check_start(t->model, mean, sd, err);
    gait_hypothesis const only = {.mean = *mean, .sd = *sd, .probability = 1.0f};
    if (s == GAIT_OK)
        tracker_start(t, &only, 1, true, utime);
    return s;
}

gait_result gait_tracker_start_hypotheses(gait_tracker *t, const gait_hypothesis *h, int32_t count,
                                          int64_t utime, gait_error *err)
{
    if (!t || !h)
        return base_null(err, "gait_tracker_start_hypotheses");
    if (count < 1 || count > GAIT_START_MAX_HYPOTHESES)
        return base_fail(err, GAIT_ERR_ARG, -1, "count = %d is outside [1, %d]", (int)count,
                         GAIT_START_MAX_HYPOTHESES);
    for (int32_t k = 0; k < count; k++) {
        gait_result const s = check_start(t->model, &h[k].mean, &h[k].sd, err);
        if (s != GAIT_OK)
            return s;
        bool fine = h[k].probability >= 0.0f && h[k].probability <= 1.0f;
        for (int32_t i = 0; i < DYNAMICS_CORRELATED; i++)
            for (int32_t j = 0; j < i; j++)
                fine &= fabsf(h[k].correlation[i][j]) <= 1.0f;
        if (!fine)
            return base_fail(err, GAIT_ERR_ARG, k,
                             "hypothesis %d: probability is outside [0, 1] or correlation outside [-1, 1]",
                             (int)k);
    }
    tracker_start(t, h, count, false, utime);
    return GAIT_OK;
}

/* Check everything in a frame that concerns one camera. */
static gait_result check_view(const gait_tracker *t, int32_t c, const gait_frame *frame, gait_error *err)
{
    gait_result s = GAIT_OK;
    gait_camera moved;
    if (frame->pose[c])
        s = check_camera_pose(&t->home[c], c, frame->pose[c], &moved, err);
    if (s == GAIT_OK && frame->image[c].data)
        s = check_image(&t->home[c], c, &frame->image[c], "image", err);
    if (s == GAIT_OK && frame->background[c].data)
        s = check_image(&t->home[c], c, &frame->background[c], "background", err);
    if (s == GAIT_OK && frame->people[c].data)
        s = check_image(&t->home[c], c, &frame->people[c], "people", err);
    return s;
}

static gait_result check_frame(const gait_tracker *t, const gait_frame *frame, gait_error *err)
{
    int64_t const before = t->core->utime;
    if (frame->utime < before || (frame->utime == before && t->core->frame > 0))
        return base_fail(err, GAIT_ERR_STATE, -1, "gait_tracker_step: utime %lld is not after %lld",
                         (long long)frame->utime, (long long)before);
    uint64_t const dt = (uint64_t)frame->utime - (uint64_t)before; /* cannot overflow */
    if ((double)dt > 1e6 * (double)t->cfg.max_dt)
        return base_fail(err, GAIT_ERR_STATE, -1,
                         "%.3f s since the last frame, max_dt is %.3f s: start again", 1e-6 * (double)dt,
                         (double)t->cfg.max_dt);
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        gait_result const s = check_view(t, c, frame, err);
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
        return base_fail(err, GAIT_ERR_STATE, -1,
                         "gait_tracker_step: not started; call gait_tracker_start() first");
    gait_frame full = {0};
    uint64_t const size = frame->struct_size ? frame->struct_size : sizeof full;
    gait_result s = fields_check_size("gait_frame", size, "its caller", err);
    if (s != GAIT_OK)
        return s;
    memcpy(&full, frame, (size_t)size);
    s = check_frame(t, &full, err);
    if (s == GAIT_OK)
        tracker_step(t, &full, out);
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
        return base_fail(err, GAIT_ERR_STATE, -1, "no estimate %d steps back: fewer steps since the start",
                         (int)back);
    fixed_lag_estimate(t, back, out);
    return GAIT_OK;
}

gait_result gait_tracker_set_particles(gait_tracker *t, int32_t particles, gait_error *err)
{
    if (!t)
        return base_fail(err, GAIT_ERR_ARG, -1, "tracker is NULL");
    if (particles < 16 || particles > t->config_particles)
        return base_fail(err, GAIT_ERR_LIMIT, -1,
                         "particles = %d is outside [16, %d], the number the tracker was made with",
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
        s[i] = particle_to_state(layout_at(t, i), &w);
        weight[i] = (float)t->filter.weight[i];
    }
    return t->cfg.particles;
}

gait_result gait_tracker_predict(const gait_tracker *t, gait_state *s, int32_t n, double dt, gait_error *err)
{
    if (!t || (n > 0 && !s))
        return base_null(err, "gait_tracker_predict");
    if (!(dt >= 0.0 && dt <= (double)t->cfg.max_dt))
        return base_fail(err, GAIT_ERR_ARG, -1, "gait_tracker_predict: dt = %g is outside [0, %g]", dt,
                         (double)t->cfg.max_dt);
    for (int32_t i = 0; i < n; i++)
        if (!kin_state_usable(t->model, &s[i]))
            return check_pose(GAIT_ERR_ARG, "gait_tracker_predict", err);
    tracker_predict(t, s, n, (float)dt);
    return GAIT_OK;
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
