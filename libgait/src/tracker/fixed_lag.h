/* fixed_lag.h - the estimate of a frame some steps ago given every frame since: the ancestors of today's particles
 * with their descendants' weights (fixed-lag smoothing; Kitagawa 1996, 4). */
#ifndef GAIT_TRACKER_FIXED_LAG_H
#define GAIT_TRACKER_FIXED_LAG_H
#include "filter/particles.h"

typedef struct fixed_lag_note { /* what an estimate says of its frame as a whole */
    int64_t age;          /* microseconds since start */
    uint64_t frame;
    double log_evidence;
    int32_t status;
    uint32_t flags;
} fixed_lag_note;

typedef struct fixed_lag {
    int32_t depth;        /* generations kept, one more than the lag and at least two */
    int32_t room, fields; /* of each */
    fixed_lag_note *note;       /* depth; a ring */
    int32_t *count;       /* depth: particles */
    float *value;         /* depth x fields x room, of which fields x count are in use */
    int32_t *parent;      /* depth x room: ancestors in the generation before */
    /* Recomputed in every call. */
    int32_t *who;   /* room: ancestors that still have descendants, */
    double *weight; /* and what these weigh */
} fixed_lag;

/* The part that is saved and hashed; then the rest.  frames: how far back estimates reach, 0 for never. */
void fixed_lag_layout_state(fixed_lag *l, arena *a, int32_t frames, int32_t n, int32_t fields);
void fixed_lag_layout_work(fixed_lag *l, arena *a);

/* The particles in a slot of the ring, and the slot so many generations before another. */
particle_set fixed_lag_particles(const fixed_lag *l, int32_t slot);
static inline int32_t fixed_lag_slot(const fixed_lag *l, int32_t slot, int32_t back)
{
    return (slot + l->depth - back) % l->depth;
}

/* Note of the current generation that its estimate is e. */
void fixed_lag_keep(gait_tracker *t, const gait_estimate *e);

/* Steps that gait_tracker_lagged() can go back now; -1: none. */
int32_t fixed_lag_reach(const gait_tracker *t);

/* Estimate of the frame `back` <= fixed_lag_reach() steps ago. */
void fixed_lag_estimate(gait_tracker *t, int32_t back, gait_estimate *out);
#endif
