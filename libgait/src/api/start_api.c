/* start_api.c - public functions of the automatic start: check the arguments, then call down. */
#include "api/check.h"
#include "api/fields.h"
#include "api/kernels.h"
#include "base/cpu.h"
#include "image/camera.h"
#include "start/start.h"

#include <string.h>

#define USUAL(meaning, type, name, array, unit, value, low, high) .name = value,
#define NO_DEFAULT(...)

void gait_start_fill(gait_start_config *cfg, size_t cfg_bytes)
{
    static const gait_start_config USUALLY = {GAIT_START_CONFIG_FIELDS(USUAL, NO_DEFAULT)};
    gait_start_config full = USUALLY;
    full.struct_size = (uint32_t)(cfg_bytes < sizeof full ? cfg_bytes : sizeof full);
    if (cfg)
        memcpy(cfg, &full, full.struct_size);
}

static gait_result check(const gait_model *m, const gait_start_config *c, gait_error *err)
{
    gait_result s = model_need_cyclic(m, err);
    if (s == GAIT_OK)
        s = fields_check_size("gait_start_config", c->struct_size, "gait_start_default", err);
    if (s == GAIT_OK && c->struct_size != sizeof *c)
        s = base_fail(err, GAIT_ERR_STRUCT, -1,
                      "start config: struct_size ends before the camera; use this library's gait_start.h");
    if (s == GAIT_OK)
        s = fields_check("gait_start_config", c, "start config: ", err);
    if (s != GAIT_OK)
        return s;
    const char *const bad = !cpu_mask_valid(c->cpu_mask) ? "cpu_mask is not ~0u or a set of GAIT_CPU_*"
                            : c->stature != 0.0f && c->stature < 0.5f
                                ? "stature is neither 0 nor in [0.5, 2.5] metres"
                            : !camera_valid(&c->camera) ? "camera: " CHECK_CAMERA
                            : !start_knows(m) ? "the model has no joints l_hip r_hip l_ankle r_ankle head_top"
                                              : NULL;
    return bad ? base_fail(err, GAIT_ERR_ARG, -1, "start config: %s", bad) : GAIT_OK;
}

gait_result gait_start_bytes(const gait_model *m, const gait_start_config *cfg, size_t *bytes,
                             gait_error *err)
{
    if (!m || !cfg || !bytes)
        return base_null(err, "gait_start_bytes");
    gait_result const result = check(m, cfg, err);
    if (result != GAIT_OK)
        return result;
    arena a = {.base = NULL};
    (void)start_layout(&a, m, cfg, kernels_choose(cfg->cpu_mask));
    *bytes = a.used;
    return GAIT_OK;
}

gait_result gait_start_init(void *mem, size_t mem_bytes, const gait_model *m, const gait_start_config *cfg,
                            gait_start **out, gait_error *err)
{
    if (!mem || !out)
        return base_null(err, "gait_start_init");
    arena a = {.base = NULL};
    gait_result result = gait_start_bytes(m, cfg, &a.used, err);
    if (result == GAIT_OK)
        result = arena_place(&a, mem, mem_bytes, err);
    if (result != GAIT_OK)
        return result;
    gait_start *const self = start_layout(&a, m, cfg, kernels_choose(cfg->cpu_mask));
    gait_state mean;
    (void)gait_tracker_prior(m, &mean, &self->prior_sd, NULL);
    *out = self;
    return GAIT_OK;
}

gait_result gait_start_set_pose(gait_start *s, const gait_camera_pose *pose, gait_error *err)
{
    if (!s || !pose)
        return base_null(err, "gait_start_set_pose");
    return check_camera_pose(&s->cfg.camera, 0, pose, &s->cfg.camera, err);
}

gait_result gait_start_add(gait_start *s, int64_t utime, const gait_keypoint *keypoints, gait_error *err)
{
    if (!s || !keypoints)
        return base_null(err, "gait_start_add");
    if (s->count > 0 && utime <= s->utime[(s->count - 1) % GAIT_START_MAX_FRAMES])
        return base_fail(err, GAIT_ERR_STATE, -1, "gait_start_add: utime %lld is not after %lld",
                         (long long)utime, (long long)s->utime[(s->count - 1) % GAIT_START_MAX_FRAMES]);
    start_add(s, utime, keypoints);
    return GAIT_OK;
}

gait_result gait_start_add_boxes(gait_start *s, int64_t utime, const gait_box *boxes, int32_t count,
                                 gait_error *err)
{
    if (!s || (!boxes && count > 0))
        return base_null(err, "gait_start_add_boxes");
    if (count < 0)
        return base_fail(err, GAIT_ERR_ARG, -1, "gait_start_add_boxes: count = %d is negative", (int)count);
    if (s->people->begun && utime <= s->people->utime)
        return base_fail(err, GAIT_ERR_STATE, -1, "gait_start_add_boxes: utime %lld is not after %lld",
                         (long long)utime, (long long)s->people->utime);
    people_add(s->people, &s->cfg.camera, utime, boxes, count);
    return GAIT_OK;
}

/* Two images of the camera's size. */
static gait_result check_images(const gait_start *s, const gait_image *frame, const gait_image *background,
                                gait_error *err)
{
    gait_result result = check_image(&s->cfg.camera, 0, frame, "image", err);
    if (result == GAIT_OK)
        result = check_image(&s->cfg.camera, 0, background, "background", err);
    return result;
}

gait_result gait_start_find_boxes(gait_start *s, const gait_image *frame, const gait_image *background,
                                  gait_box *out, int32_t capacity, int32_t *count, gait_error *err)
{
    if (!s || !frame || !background || !out || !count)
        return base_null(err, "gait_start_find_boxes");
    if (capacity < 1)
        return base_fail(err, GAIT_ERR_ARG, -1, "capacity is %d: give 1 or more", (int)capacity);
    gait_result const result = check_images(s, frame, background, err);
    if (result == GAIT_OK)
        *count = blob_find(&s->blobs, frame, background, out, capacity);
    return result;
}

gait_result gait_start_other_scene(gait_start *s, const gait_image *frame, const gait_image *background,
                                   int32_t *other, gait_error *err)
{
    if (!s || !frame || !background || !other)
        return base_null(err, "gait_start_other_scene");
    gait_result const result = check_images(s, frame, background, err);
    if (result == GAIT_OK)
        *other = blob_other_scene(&s->blobs, frame, background);
    return result;
}

gait_result gait_start_box_stature(const gait_start *s, const gait_box *box, float *stature, gait_error *err)
{
    start_box b;
    if (!s || !box || !stature)
        return base_null(err, "gait_start_box_stature");
    if (!people_box(&s->cfg.camera, box, &b))
        return base_fail(err, GAIT_ERR_ARG, -1, "box: numbers must be finite and sd not negative");
    *stature = (float)people_stature(&s->cfg.camera, &b);
    return GAIT_OK;
}

void gait_start_reset(gait_start *s)
{
    if (s)
        start_reset(s);
}

gait_result gait_start_solve(gait_start *s, int64_t utime, gait_hypothesis *out, int32_t capacity,
                             int32_t *count, gait_error *err)
{
    if (!s || !out || !count)
        return base_null(err, "gait_start_solve");
    if (capacity < 1)
        return base_fail(err, GAIT_ERR_ARG, -1, "capacity is %d: give 1 or more", capacity);
    int32_t const found = start_solve(s, utime, out, capacity);
    if (found < 0)
        return base_fail(
            err, GAIT_ERR_STATE, -1,
            "too few frames show hips and ankles: add four or more over 0.3 s, or eight boxes of a "
            "person over %.1f s",
            (double)s->cfg.box_time);
    if (found == 0)
        return base_fail(err, GAIT_ERR_NUMERIC, -1, "no walk fits the observations");
    *count = found;
    return GAIT_OK;
}

int32_t gait_hypothesis_walks(const gait_hypothesis *h)
{
    return h && start_walks(h);
}
