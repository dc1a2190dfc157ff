/* stream.h - lifting frame after frame.
 *
 * Segments begin at regular intervals, each where the one before it predicts the body.  Every frame is added to the
 * segments that cover it, and an estimate blends the segments that cover a moment.  A segment that does not fit is
 * searched for again. */
#ifndef GAIT_LIFT_STREAM_H
#define GAIT_LIFT_STREAM_H
#include "lift/robust.h"

typedef struct stream_segment {
    int64_t index;                /* it begins at index x hop / fps */
    int32_t best;                 /* component of the largest evidence */
    bool closed;                  /* no more frames will be added */
    int32_t outliers;             /* numbers observed that are down-weighted */
    segment_posterior *posterior; /* K */
} stream_segment;

typedef struct lift_past { /* the last frames, a ring */
    int32_t capacity;
    int64_t *utime;
    double *uv;       /* capacity x J x 2, ideal */
    double *sd, *raw; /* capacity x J: down-weighted; as observed */
} lift_past;

typedef struct lift_stream {
    lift_past past;
    stream_segment *segment; /* ring of `segments`: those of the last indices */
    int32_t segments;
    double *at, *uv;           /* window for a fit: past.capacity moments and observations */
    lift_robust robust;        /* its standard deviations */
    double *scratch;           /* 2 x past.capacity */
    double *guess, *mean, *sd; /* J x 3 */
    double *new_uv, *new_sd;   /* the frame being pushed */
    double span, step; /* seconds: from a segment's first frame to its last; to the next segment's first */
    /* cleared by a reset, from here on: */
    uint64_t pushed; /* frames since the start */
    int64_t origin;  /* utime of the first segment; -1: no person has been observed yet */
    int64_t last;    /* utime of the last frame */
    int64_t next;    /* index of the next segment; 0: none has been fitted yet */
    bool poor_fit;   /* the last segment was searched for again, or the first one fits poorly */
} lift_stream;

void lift_stream_layout(arena *a, const lift_table *t, lift_stream *s);
void lift_stream_reset(lift_stream *s);
/* One frame, ideal pixels.  false: numbers out of range; the stream was reset. */
bool lift_stream_push(const lift_table *t, lift_search *search, lift_stream *s, int64_t utime,
                      const lift_observations *observed);
/* The frame `lag` frames before the last, or the earliest that is still covered.  false: there are too few frames. */
bool lift_stream_estimate(const lift_table *t, const lift_stream *s, gait_lift_frame *out);
#endif
