/* model_api.c - public functions of the library and of models: check the arguments, then one call down. */
#include "api/check.h"
#include "api/kernels.h"
#include "base/cpu.h"
#include "image/camera.h"
#include "model/kinematics.h"
#include "raster/render.h"

#include <string.h>

uint32_t gait_version(void)
{
    return GAIT_VERSION;
}

uint32_t gait_abi(void)
{
    return GAIT_ABI;
}

uint32_t gait_cpu_features(void)
{
    return cpu_features();
}

const char *gait_cpu_name(uint32_t mask)
{
    return kernels_choose(mask)->isa;
}

const char *gait_result_name(gait_result s)
{
    static const char names[][20] = {
        "GAIT_OK",        "GAIT_ERR_ARG",     "GAIT_ERR_STRUCT",  "GAIT_ERR_MEMORY", "GAIT_ERR_LIMIT",
        "GAIT_ERR_MAGIC", "GAIT_ERR_VERSION", "GAIT_ERR_CORRUPT", "GAIT_ERR_STATE",  "GAIT_ERR_NUMERIC"};
    uint32_t const i = 0u - (uint32_t)s;
    return i < sizeof names / sizeof *names ? names[i] : "unknown gait_result";
}

gait_result gait_camera_check(const gait_camera *camera, gait_error *err)
{
    if (!camera)
        return base_null(err, "gait_camera_check");
    gait_result const s = check_camera(camera, -1, err);
    return s == GAIT_OK ? camera_check_place(camera, err) : s;
}

gait_result gait_model_bytes(const void *data, size_t data_bytes, size_t *bytes, gait_error *err)
{
    if (!data || !bytes)
        return base_null(err, "gait_model_bytes");
    gait_model m[GAIT_MAX_CLASSES];
    gait_result const s = model_open(data, data_bytes, m, err);
    if (s != GAIT_OK)
        return s;
    arena a = {.base = NULL};
    (void)model_layout(&a, m);
    *bytes = a.used;
    return GAIT_OK;
}

gait_result gait_model_init(void *mem, size_t mem_bytes, const void *data, size_t data_bytes,
                            gait_model **out, gait_error *err)
{
    if (!mem || !data || !out)
        return base_null(err, "gait_model_init");
    gait_model m[GAIT_MAX_CLASSES];
    gait_result s = model_open(data, data_bytes, m, err);
    if (s != GAIT_OK)
        return s;
    arena a = {.base = NULL};
    (void)model_layout(&a, m);
    s = arena_place(&a, mem, mem_bytes, err);
    if (s == GAIT_OK)
        *out = model_layout(&a, m);
    return s;
}

gait_result gait_model_get_info(const gait_model *m, gait_model_info *out, gait_error *err)
{
    if (!m || !out)
        return base_null(err, "gait_model_get_info");
    *out = (gait_model_info){.joints = m->points,
                             .angles = m->angles,
                             .components = m->components,
                             .proportions = m->proportions,
                             .phases = m->phases,
                             .limbs = m->limbs,
                             .stride_hz = m->stride_hz,
                             .stride_hz_sd = m->stride_hz_sd,
                             .stride_length = m->stride_length,
                             .stride_length_sd = m->stride_length_sd,
                             .cyclic = m->cyclic,
                             .posture_angles = model_posture_angles(m),
                             .classes = m->classes,
                             .direction = m->direction,
                             .digest = m->digest};
    return GAIT_OK;
}

const char *gait_model_joint_name(const gait_model *m, int32_t joint)
{
    return m && joint >= 0 && joint < m->points ? m->point_name[joint] : NULL;
}

const char *gait_model_angle_name(const gait_model *m, int32_t angle)
{
    return m && angle >= 0 && angle < m->angles ? m->channel_name[angle] : NULL;
}

const char *gait_model_limb_name(const gait_model *m, int32_t limb)
{
    return m && limb >= 0 && limb < m->limbs ? m->limb_name[limb] : NULL;
}

const char *gait_model_class_name(const gait_model *m, int32_t motion_class)
{
    bool const there = m && m->cyclic && motion_class >= 0 && motion_class < m->classes;
    return !there ? NULL : m->class_name ? m->class_name[motion_class] : "walk";
}

const gait_model *gait_model_of_class(const gait_model *m, int32_t motion_class)
{
    return m && motion_class >= 0 && motion_class < m->classes ? m->of_class[motion_class] : NULL;
}

gait_result gait_model_angle_mask(const gait_model *m, const char *names, uint32_t *mask, gait_error *err)
{
    if (!m || !names || !mask)
        return base_null(err, "gait_model_angle_mask");
    uint32_t found = 0;
    for (const char *at = names + strspn(names, " "); *at; at += strspn(at, " ")) {
        size_t const length = strcspn(at, " ");
        int32_t const a = model_find_angle(m, at, length);
        if (a < 0)
            return base_fail(err, GAIT_ERR_ARG, -1, "gait_model_angle_mask: the model has no angle %.*s",
                             (int)length, at);
        found |= UINT32_C(1) << a;
        at += length;
    }
    *mask = found;
    return GAIT_OK;
}

gait_result gait_model_pose(const gait_model *m, const gait_state *s, gait_pose *out, gait_error *err)
{
    if (!m || !s || !out)
        return base_null(err, "gait_model_pose");
    gait_result const fault = model_need_cyclic(m, err);
    return fault != GAIT_OK ? fault : check_pose(model_pose_state(m, s, out), "gait_model_pose", err);
}

gait_result gait_model_pelvis_height(const gait_model *m, const gait_state *s, float *out, gait_error *err)
{
    if (!m || !s || !out)
        return base_null(err, "gait_model_pelvis_height");
    gait_result const fault = model_need_cyclic(m, err);
    return fault != GAIT_OK ? fault
                            : check_pose(model_pelvis_height(m, s, out), "gait_model_pelvis_height", err);
}

gait_result gait_render(const gait_model *m, const gait_camera *cam, const gait_state *s, uint8_t *ids,
                        int32_t ids_stride, gait_error *err)
{
    if (!m || !cam || !s || !ids)
        return base_null(err, "gait_render");
    gait_result fault = model_need_cyclic(m, err);
    if (fault == GAIT_OK)
        fault = check_camera(cam, -1, err);
    if (fault != GAIT_OK)
        return fault;
    if (ids_stride < cam->width)
        return base_fail(err, GAIT_ERR_ARG, -1,
                         "gait_render: ids_stride = %d is below the camera's width of %d", (int)ids_stride,
                         (int)cam->width);
    return check_pose(render_limbs(m, cam, s, ids, ids_stride), "gait_render", err);
}
