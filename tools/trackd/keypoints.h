/* keypoints.h - 2-D keypoints of a detector: read from an encoded gaitmsg.tracks_t or tracks2_t, and used as a term of the
 * likelihood. */
#ifndef TRACKD_KEYPOINTS_H
#define TRACKD_KEYPOINTS_H
#include "byte_reader.h"
#include "common.h"
#include "gait.h"
#include "gait_lift.h"

/* ---- messages: read in place, every length checked, nothing copied. */
typedef struct keypoints_view {
    int64_t utime, frame;
    int32_t count;
    bool profiled;    /* the message states the errors of each keypoint */
    byte_reader rest; /* keypoints not yet read */
} keypoints_view;

typedef struct keypoint_view {
    const char *name; /* in the message */
    float u, v, confidence;
    float sd, lasting_sd, correlation; /* as in track2_t; sd -1: not stated */
} keypoint_view;

/* Selects the keypoints that are used: those that the model knows, each once per message, with a valid confidence. */
typedef struct keypoints_filter {
    int64_t left_out;             /* number of other keypoints */
    bool reported[3];             /* reasons that have been reported on stderr */
    bool named[GAIT_MAX_MARKERS]; /* joints that occurred in this message */
} keypoints_filter;

/* A new message begins. */
void keypoints_filter_begin(keypoints_filter *f);
/* Whether to use a keypoint.  `joint`: its index in the model, -1 if unknown. */
bool keypoints_filter_pass(keypoints_filter *f, const keypoint_view *k, int32_t joint);

/* false if the message has another type or is shorter than its lengths state. */
bool keypoints_view_open(keypoints_view *v, const void *message_bytes, size_t size, message *why);
/* The next keypoint; false: there are no more. */
bool keypoints_view_next(keypoints_view *v, keypoint_view *out);
/* Standard deviation of a keypoint, pixels: as stated or, from `sd`, by its confidence.  -1: not seen. */
double keypoints_view_sd(const keypoint_view *k, double sd);
/* The same, increased so that frames `step` seconds apart can be treated as independent; the lasting part of the error is
 * not increased.  step 0: there was no frame before. */
double keypoints_view_independent_sd(const keypoint_view *k, double sd, double step);
/* Report that no keypoint of a message is known; returns false. */
bool keypoints_view_unknown(message *why);

/* ---- 2-D keypoints of a detector as a term of the tracker's likelihood.
 *
 * They belong to the frame of the same capture time.  A detector takes time, so a frame waits for its keypoints, at most
 * until the next frame arrives. */
enum { KEYPOINT_CUE_PAST = 8 }; /* messages that wait for their frames */

typedef struct cue_keypoints {
    int64_t utime; /* of the frame; -1: none */
    bool observed; /* at least one joint is */
    gait_keypoint joint[GAIT_MAX_JOINTS];
} cue_keypoints;

typedef struct keypoint_cue {
    const gait_model *model;
    int32_t joints;
    float sd; /* pixels, of a keypoint with confidence 1 */
    cue_keypoints past[KEYPOINT_CUE_PAST];
    keypoints_filter filter;
    int64_t messages, used,
        late;            /* messages: that arrived; that a frame used; that arrived after their frame */
    int64_t frame_utime; /* of the last tracked frame; -1: none */
    int64_t unseen;      /* microseconds of frames since the last one that had keypoints */
} keypoint_cue;

/* `model` must outlive `cue`. */
void keypoint_cue_open(keypoint_cue *cue, const gait_model *model, int32_t joints, float sd);
/* The tracker continues after a frame of this time. */
void keypoint_cue_resume(keypoint_cue *cue, int64_t utime);
/* Tracking has stopped: accept keypoints of any time again. */
void keypoint_cue_forget(keypoint_cue *cue);
/* Keep the keypoints of one message.  false if none is known to the model or their frame has been tracked. */
bool keypoint_cue_take(keypoint_cue *cue, keypoints_view *v, message *why);
/* Whether the message for the frame with this capture time has arrived. */
bool keypoint_cue_arrived(const keypoint_cue *cue, int64_t utime);
/* Keypoints of that frame, in the order of the model's joints; NULL: none have arrived, or the message reports that no joint
 * is seen. */
const gait_keypoint *keypoint_cue_at(const keypoint_cue *cue, int64_t utime);
/* The same for the frame that is being tracked, and count it. */
const gait_keypoint *keypoint_cue_use(keypoint_cue *cue, int64_t utime);
#endif
