/* tracks_cue.h - 2-D joints of a detector as a term of the tracker's likelihood.
 *
 * They belong to the frame of their capture time.  A detector needs a while, so a frame whose joints have not come
 * is held until they do, at the longest until the next frame comes. */
#ifndef TOOLS_TRACKS_CUE_H
#define TOOLS_TRACKS_CUE_H
#include "gait.h"
#include "tracks_view.h"

enum { TRACKS_CUE_PAST = 8 }; /* messages that wait for their frames */

typedef struct cue_joints {
    int64_t utime; /* of the frame; -1: none */
    gait_track track[GAIT_MAX_JOINTS];
} cue_joints;

typedef struct tracks_cue {
    const gait_model *model;
    int32_t joints;
    float sd; /* pixels, of a joint with full confidence */
    cue_joints past[TRACKS_CUE_PAST];
    tracks_sieve sieve;
    int64_t messages, used, late; /* tracks that came, that a frame had, that came after it */
    int64_t frame_utime;          /* of the last frame tracked; -1: none */
    uint8_t *held;                /* an encoded image_t; taken once */
    size_t room, held_bytes;      /* held_bytes 0: none is held */
    int64_t held_utime, held_arrival;
} tracks_cue;

/* `cue` is all zero before.  `model` must outlive it. */
void tracks_cue_open(tracks_cue *cue, const gait_model *model, int32_t joints, float sd);
/* Nobody is tracked any more: tracks of any time may be of a frame to come. */
void tracks_cue_forget(tracks_cue *cue);
void tracks_cue_close(tracks_cue *cue);
/* Take the memory for one frame of a camera; only once. */
bool tracks_cue_room(tracks_cue *cue, const gait_camera *camera, message *why);
/* Keep the joints of one message.  false, with the reason: of no joint of the model, or after their frame. */
bool tracks_cue_take(tracks_cue *cue, tracks_view *v, message *why);
/* Joints of the frame captured then, the model's in order; NULL: none have come. */
const gait_track *tracks_cue_at(const tracks_cue *cue, int64_t utime);
/* The same for the frame that is being tracked; it is counted. */
const gait_track *tracks_cue_use(tracks_cue *cue, int64_t utime);
/* Hold an encoded frame; false: it is larger than frames are. */
bool tracks_cue_hold(tracks_cue *cue, int64_t utime, const void *image, size_t bytes, int64_t arrival);
#endif
