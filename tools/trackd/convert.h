/* convert.h - between the structs of gait.h and the messages of package gaitmsg. */
#ifndef TRACKD_CONVERT_H
#define TRACKD_CONVERT_H
#include "gait.h"
#include "gaitmsg_estimate_t.h"
#include "gaitmsg_state_t.h"
#include "common.h"

/* An estimate message with the arrays it points to; it must not move once filled. */
typedef struct estimate_message {
    gaitmsg_estimate_t msg;
    gaitmsg_joint_t joint[GAIT_MAX_JOINTS];
    gaitmsg_angle_t angle[GAIT_MAX_ANGLES];
} estimate_message;

void convert_state(const gait_state *in, const gait_model_info *info, gaitmsg_state_t *out);
/* Fields that are not numbers become those of `unknown`; components and offsets beyond the message's are 0. */
bool convert_state_message(const gaitmsg_state_t *in, const gait_state *unknown, gait_state *out,
                           message *why);
/* Sets all fields but frame, step, dropped, receive_utime, step_us and tracker_digest, which the caller sets. */
void convert_estimate(const gait_model *model, const gait_model_info *info, const gait_estimate *in,
                      estimate_message *out);
#endif
