/* abi.c - layout of every public struct, so that bindings can check themselves on import. */
#include "base.h"

/* A struct's own row comes first, then its fields in order. */
#define STRUCT(T)   {#T, NULL, 0, (uint32_t)sizeof(T)}
#define FIELD(T, f) {#T, #f, (uint32_t)offsetof(T, f), (uint32_t)sizeof(((T *)0)->f)}

const gait_abi_field *gait_abi_fields(uint32_t *count)
{
    static const gait_abi_field table[] = {
        STRUCT(gait_error),
        FIELD(gait_error, status), FIELD(gait_error, index), FIELD(gait_error, text),
        STRUCT(gait_image),
        FIELD(gait_image, data), FIELD(gait_image, width), FIELD(gait_image, height),
        FIELD(gait_image, stride), FIELD(gait_image, format),
        STRUCT(gait_camera),
        FIELD(gait_camera, width), FIELD(gait_camera, height), FIELD(gait_camera, fx),
        FIELD(gait_camera, fy), FIELD(gait_camera, cx), FIELD(gait_camera, cy), FIELD(gait_camera, R),
        FIELD(gait_camera, t), FIELD(gait_camera, distortion),
        STRUCT(gait_state),
        FIELD(gait_state, phase), FIELD(gait_state, stride_hz), FIELD(gait_state, stature),
        FIELD(gait_state, heading), FIELD(gait_state, pitch), FIELD(gait_state, roll),
        FIELD(gait_state, pelvis), FIELD(gait_state, coef), FIELD(gait_state, offset),
        STRUCT(gait_pose),
        FIELD(gait_pose, joint), FIELD(gait_pose, angle),
        STRUCT(gait_tasks),
        FIELD(gait_tasks, run), FIELD(gait_tasks, user),
        STRUCT(gait_model_info),
        FIELD(gait_model_info, joints), FIELD(gait_model_info, angles), FIELD(gait_model_info, components),
        FIELD(gait_model_info, phases), FIELD(gait_model_info, limbs), FIELD(gait_model_info, reserved),
        FIELD(gait_model_info, stride_hz), FIELD(gait_model_info, stride_hz_sd),
        FIELD(gait_model_info, stride_length), FIELD(gait_model_info, stride_length_sd),
        FIELD(gait_model_info, digest),
        STRUCT(gait_tracker_config),
        FIELD(gait_tracker_config, struct_size), FIELD(gait_tracker_config, mode),
        FIELD(gait_tracker_config, seed), FIELD(gait_tracker_config, particles),
        FIELD(gait_tracker_config, components), FIELD(gait_tracker_config, tasks),
        FIELD(gait_tracker_config, cameras), FIELD(gait_tracker_config, terms),
        FIELD(gait_tracker_config, term_weight), FIELD(gait_tracker_config, missed_weight),
        FIELD(gait_tracker_config, girth), FIELD(gait_tracker_config, resample_ess),
        FIELD(gait_tracker_config, max_dt), FIELD(gait_tracker_config, phase_noise),
        FIELD(gait_tracker_config, rate_noise), FIELD(gait_tracker_config, rate_noise_start),
        FIELD(gait_tracker_config, settle_time),
        FIELD(gait_tracker_config, rate_time), FIELD(gait_tracker_config, forward_noise),
        FIELD(gait_tracker_config, lateral_noise), FIELD(gait_tracker_config, vertical_noise),
        FIELD(gait_tracker_config, heading_noise), FIELD(gait_tracker_config, tilt_noise),
        FIELD(gait_tracker_config, tilt_time), FIELD(gait_tracker_config, coef_noise),
        FIELD(gait_tracker_config, coef_time), FIELD(gait_tracker_config, stature_noise),
        FIELD(gait_tracker_config, offset_noise), FIELD(gait_tracker_config, offset_sd),
        FIELD(gait_tracker_config, offset_angles),
        FIELD(gait_tracker_config, camera), FIELD(gait_tracker_config, exec),
        STRUCT(gait_frame),
        FIELD(gait_frame, utime), FIELD(gait_frame, image),
        STRUCT(gait_estimate),
        FIELD(gait_estimate, utime), FIELD(gait_estimate, frame), FIELD(gait_estimate, log_evidence),
        FIELD(gait_estimate, mean), FIELD(gait_estimate, sd), FIELD(gait_estimate, best),
        FIELD(gait_estimate, pose), FIELD(gait_estimate, joint_sd), FIELD(gait_estimate, ess),
        FIELD(gait_estimate, phase_r), FIELD(gait_estimate, mode_mass), FIELD(gait_estimate, speed),
        FIELD(gait_estimate, status), FIELD(gait_estimate, flags), FIELD(gait_estimate, reserved),
    };
    if (count)
        *count = (uint32_t)(sizeof table / sizeof *table);
    return table;
}
