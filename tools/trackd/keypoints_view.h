/* keypoints_view.h - look into an encoded gaitmsg.tracks_t where it lies: every length is checked, nothing is copied. */
#ifndef TRACKD_KEYPOINTS_VIEW_H
#define TRACKD_KEYPOINTS_VIEW_H
#include "byte_reader.h"
#include "gait_lift.h"
#include "message.h"

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
#endif
