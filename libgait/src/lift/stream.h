/* stream.h - lifting frame after frame.
 *
 * Segments begin at the ticks of a grid, each where the one before it will be.  Every frame is added to the segments it
 * falls into, and an estimate blends those that cover a moment.  A segment that does not fit is searched for anew. */
#ifndef GAIT_LIFT_STREAM_H
#define GAIT_LIFT_STREAM_H
#include "lift/robust.h"

typedef struct stream_segment {
    int64_t index;                /* it begins at index x hop / fps */
    int32_t best;                 /* component of the largest evidence */
    bool closed;                  /* no frame will be added any more */
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
    double *new_uv, *new_sd;   /* the frame that comes in */
    double span, step; /* seconds: from a segment's first frame to its last; to the next segment's first */
    /* from here on cleared by a reset */
    uint64_t pushed; /* frames since the start */
    int64_t origin;  /* utime of the first segment; -1: no person was observed yet */
    int64_t last;    /* utime of the last frame */
    int64_t next;    /* index of the next segment; 0: none was fitted yet */
    bool poor_fit;   /* the last segment was searched for anew, or the first fits badly */
} lift_stream;

void lift_stream_layout(arena *a, const lift_table *t, lift_stream *s);
void lift_stream_reset(lift_stream *s);
/* One frame, ideal pixels.  false: numbers out of range; the stream has started anew. */
bool lift_stream_push(const lift_table *t, lift_search *search, lift_stream *s, int64_t utime,
                      const lift_observations *observed);
/* The frame `lag` frames before the last, or the earliest that is still covered.  false: not so many frames yet. */
bool lift_stream_estimate(const lift_table *t, const lift_stream *s, gait_lift_frame *out);
#endif
