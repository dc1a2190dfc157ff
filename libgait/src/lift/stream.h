/* stream.h - frame after frame: segments begin at the ticks of a grid, every frame is added to those
 * it falls into, and an estimate blends those that cover a moment. */
#ifndef GAIT_LIFT_STREAM_H
#define GAIT_LIFT_STREAM_H
#include "lift/spikes.h"

typedef struct stream_segment { /* one segment */
    int64_t index;         /* it begins at index x hop / fps */
    int32_t best;          /* component of the largest evidence */
    bool closed;           /* no frame will be added any more */
    int32_t doubted;       /* numbers observed that have lost their say */
    segment_posterior *belief;   /* K */
} stream_segment;

typedef struct lift_past { /* frames that may be needed again, a ring */
    int32_t room;
    int64_t *utime;
    double *uv;       /* room x J x 2, ideal */
    double *sd, *raw; /* room x J: what the points have to say; as observed */
} lift_past;

typedef struct lift_stream {
    lift_past past;
    stream_segment *part; /* ring of `parts`: those of the last indices */
    int32_t parts;
    double *at, *uv, *sd; /* window for a fit: past.room moments and observations */
    double *calm;         /* deviations of the points in it that do not jump */
    lift_spikes_scratch jump;
    double *guess, *mean, *spread; /* J x 3 */
    double *new_uv, *new_sd;       /* the frame that comes in */
    double span, step; /* seconds: from a segment's first frame to its last; to the next segment's first */
    /* from here on cleared by a reset */
    uint64_t pushed; /* frames since the start */
    int64_t origin;  /* utime of the first segment; -1: nobody was seen yet */
    int64_t last;    /* utime of the last frame */
    int64_t next;    /* index of the next segment; 0: none was fitted yet */
    bool misfit;     /* the last segment was searched for anew, or the first fits badly */
} lift_stream;

void lift_stream_layout(arena *a, const lift_table *t, lift_stream *s);
void lift_stream_reset(lift_stream *s);
/* One frame, ideal pixels.  false: numbers out of range; the stream has started anew. */
bool lift_stream_push(const lift_table *t, lift_search *search, lift_stream *s, int64_t utime,
                      const lift_seen *seen);

static inline stream_segment *lift_stream_segment(const lift_stream *s, int64_t index)
{
    return &s->part[index % s->parts];
}

static inline lift_seen lift_stream_frame(const lift_table *t, const lift_stream *s, uint64_t frame)
{
    size_t const i = (size_t)(frame % (uint64_t)s->past.room), J = (size_t)t->prior.markers;
    return (lift_seen){.uv = s->past.uv + i * J * 2, .sd = s->past.sd + i * J};
}

/* The same with the deviations that were observed. */
static inline lift_seen lift_stream_raw(const lift_table *t, const lift_stream *s, uint64_t frame)
{
    lift_seen seen = lift_stream_frame(t, s, frame);
    seen.sd = s->past.raw + frame % (uint64_t)s->past.room * (size_t)t->prior.markers;
    return seen;
}

/* First frame that is still there. */
static inline uint64_t lift_stream_oldest(const lift_stream *s)
{
    uint64_t const room = (uint64_t)s->past.room;
    return s->pushed > room ? s->pushed - room : 0;
}

/* Seconds since the stream's origin. */
static inline double lift_stream_time(const lift_stream *s, uint64_t frame)
{
    return 1e-6 * (double)(s->past.utime[frame % (uint64_t)s->past.room] - s->origin);
}

static inline bool lift_stream_covers(const lift_stream *s, int64_t index, double time)
{
    double const since = time - (double)index * s->step;
    return since >= -1e-9 && since <= s->span + 1e-9;
}

static inline double lift_stream_moment(const lift_table *t, const lift_stream *s, int64_t index, double time)
{
    return (time - (double)index * s->step) * (double)t->prior.fps;
}

#endif
