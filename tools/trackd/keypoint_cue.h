/* keypoint_cue.h - 2-D joints of a detector as a term of the tracker's likelihood.
 *
 * They belong to the frame of their capture time.  A detector needs a while, so a frame whose joints have not come
 * is held until they do, at the longest until the next frame comes. */
#ifndef TRACKD_KEYPOINT_CUE_H
#define TRACKD_KEYPOINT_CUE_H
#include "gait.h"
#include "keypoints_view.h"

enum { KEYPOINT_CUE_PAST = 8 }; /* messages that wait for their frames */

typedef struct cue_joints {
    int64_t utime; /* of the frame; -1: none */
    gait_keypoint track[GAIT_MAX_JOINTS];
} cue_joints;

typedef struct keypoint_cue {
    const gait_model *model;
    int32_t joints;
    float sd; /* pixels, of a joint with full confidence */
    cue_joints past[KEYPOINT_CUE_PAST];
    keypoints_sieve sieve;
    int64_t messages, used, late; /* tracks that came, that a frame had, that came after it */
    int64_t frame_utime;          /* of the last frame tracked; -1: none */
    uint8_t *held;                /* an encoded image_t; taken once */
    size_t room, held_bytes;      /* held_bytes 0: none is held */
    int64_t held_utime, held_arrival;
} keypoint_cue;

/* `cue` is all zero before.  `model` must outlive it. */
void keypoint_cue_open(keypoint_cue *cue, const gait_model *model, int32_t joints, float sd);
/* Nobody is tracked any more: tracks of any time may be of a frame to come. */
void keypoint_cue_forget(keypoint_cue *cue);
void keypoint_cue_close(keypoint_cue *cue);
/* Take the memory for one frame of a camera; only once. */
bool keypoint_cue_room(keypoint_cue *cue, const gait_camera *camera, message *why);
/* Keep the joints of one message.  false, with the reason: of no joint of the model, or after their frame. */
bool keypoint_cue_take(keypoint_cue *cue, keypoints_view *v, message *why);
/* Joints of the frame captured then, the model's in order; NULL: none have come. */
const gait_keypoint *keypoint_cue_at(const keypoint_cue *cue, int64_t utime);
/* The same for the frame that is being tracked; it is counted. */
const gait_keypoint *keypoint_cue_use(keypoint_cue *cue, int64_t utime);
/* Hold an encoded frame; false: it is larger than frames are. */
bool keypoint_cue_hold(keypoint_cue *cue, int64_t utime, const void *image, size_t bytes, int64_t arrival);
#endif
