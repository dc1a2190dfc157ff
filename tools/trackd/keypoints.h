/* keypoints.h - 2-D keypoints of a detector: read from an encoded gaitmsg.tracks_t, and used as a term of the likelihood. */
#ifndef TRACKD_KEYPOINTS_H
#define TRACKD_KEYPOINTS_H
#include "byte_reader.h"
#include "common.h"
#include "gait.h"
#include "gait_lift.h"

/* ---- look into an encoded gaitmsg.tracks_t where it lies: every length is checked, nothing is copied. */
typedef struct keypoints_view {
    int64_t utime, frame;
    int32_t count;
    byte_reader tracks; /* what keypoints_view_next() goes through */
} keypoints_view;

typedef struct track_view {
    const char *name; /* in the message */
    float u, v, confidence;
} track_view;

/* Which points of messages a model takes: those that it knows, each once, with a confidence from 0 to 1. */
typedef struct keypoints_sieve {
    int64_t left_out;             /* points */
    bool told[3];                 /* by reason, once on stderr */
    bool named[GAIT_MAX_MARKERS]; /* by the message so far */
} keypoints_sieve;

/* A new message begins. */
void keypoints_sieve_begin(keypoints_sieve *s);
/* Is the point of use?  `joint` is its index in the model, -1: unknown. */
bool keypoints_sieve_pass(keypoints_sieve *s, const track_view *track, int32_t joint);

/* false, with the reason: another type, or shorter than its lengths say. */
bool keypoints_view_open(keypoints_view *v, const void *message_bytes, size_t size, message *why);
/* The next track; false: there are no more. */
bool keypoints_view_next(keypoints_view *v, track_view *out);
/* Deviation of a track, pixels, where one with full confidence has `sd`; -1: not seen. */
double keypoints_view_sd(const track_view *track, double sd);
/* false, with the reason that no track of a message is of a joint that is known. */
bool keypoints_view_strangers(message *why);

/* ---- 2-D joints of a detector as a term of the tracker's likelihood.
 *
 * They belong to the frame of their capture time.  A detector needs a while, so a frame whose joints have not come
 * is held until they do, at the longest until the next frame comes. */
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
