/* abi.c - layout of every public struct, so that bindings can check themselves. */
#include "base.h"

/* S(type) begins a struct, F(type, field) lists its fields in order. */
#define ABI_TABLE(S, F)                                                                                         \
    S(gait_error) F(gait_error, status) F(gait_error, index) F(gait_error, text)                                \
    S(gait_image) F(gait_image, data) F(gait_image, width) F(gait_image, height) F(gait_image, stride)          \
    F(gait_image, format)                                                                                       \
    S(gait_camera) F(gait_camera, width) F(gait_camera, height) F(gait_camera, fx) F(gait_camera, fy)           \
    F(gait_camera, cx) F(gait_camera, cy) F(gait_camera, R) F(gait_camera, t) F(gait_camera, distortion)        \
    S(gait_state) F(gait_state, phase) F(gait_state, stride_hz) F(gait_state, stature) F(gait_state, heading)   \
    F(gait_state, pitch) F(gait_state, roll) F(gait_state, pelvis) F(gait_state, coef)                          \
    S(gait_pose) F(gait_pose, joint) F(gait_pose, angle)                                                        \
    S(gait_tasks) F(gait_tasks, run) F(gait_tasks, user)                                                        \
    S(gait_model_info) F(gait_model_info, joints) F(gait_model_info, angles) F(gait_model_info, components)     \
    F(gait_model_info, phases) F(gait_model_info, limbs) F(gait_model_info, reserved)                           \
    F(gait_model_info, stride_hz) F(gait_model_info, stride_hz_sd) F(gait_model_info, stride_length)            \
    F(gait_model_info, stride_length_sd) F(gait_model_info, digest)                                             \
    S(gait_tracker_config) F(gait_tracker_config, struct_size) F(gait_tracker_config, mode)                     \
    F(gait_tracker_config, seed) F(gait_tracker_config, particles) F(gait_tracker_config, components)           \
    F(gait_tracker_config, tasks) F(gait_tracker_config, cameras) F(gait_tracker_config, terms)                 \
    F(gait_tracker_config, term_weight) F(gait_tracker_config, missed_weight) F(gait_tracker_config, girth)     \
    F(gait_tracker_config, resample_ess) F(gait_tracker_config, max_dt) F(gait_tracker_config, phase_noise)     \
    F(gait_tracker_config, rate_noise) F(gait_tracker_config, rate_noise_start)                                 \
    F(gait_tracker_config, settle_time) F(gait_tracker_config, forward_noise)                                   \
    F(gait_tracker_config, lateral_noise) F(gait_tracker_config, vertical_noise)                                \
    F(gait_tracker_config, heading_noise) F(gait_tracker_config, tilt_noise) F(gait_tracker_config, tilt_time)  \
    F(gait_tracker_config, coef_noise) F(gait_tracker_config, coef_time)                                        \
    F(gait_tracker_config, stature_noise) F(gait_tracker_config, camera) F(gait_tracker_config, exec)           \
    S(gait_frame) F(gait_frame, utime) F(gait_frame, image)                                                     \
    S(gait_estimate) F(gait_estimate, utime) F(gait_estimate, frame) F(gait_estimate, log_evidence)             \
    F(gait_estimate, mean) F(gait_estimate, sd) F(gait_estimate, best) F(gait_estimate, pose)                   \
    F(gait_estimate, joint_sd) F(gait_estimate, ess) F(gait_estimate, phase_r) F(gait_estimate, mode_mass)      \
    F(gait_estimate, speed) F(gait_estimate, status) F(gait_estimate, flags) F(gait_estimate, reserved)

#define STRUCT_ROW(T)   {#T, NULL, 0, (uint32_t)sizeof(T)},
#define FIELD_ROW(T, f) {#T, #f, (uint32_t)offsetof(T, f), (uint32_t)sizeof(((T *)0)->f)},

const gait_abi_field *gait_abi_fields(uint32_t *count)
{
    static const gait_abi_field table[] = {ABI_TABLE(STRUCT_ROW, FIELD_ROW)};
    if (count)
        *count = (uint32_t)(sizeof table / sizeof *table);
    return table;
}
