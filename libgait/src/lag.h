/* lag.h - the estimate of a frame some steps ago given every frame since: the ancestors of today's particles
 * with their descendants' weights (fixed-lag smoothing; Kitagawa 1996, 4). */
#ifndef GAIT_LAG_H
#define GAIT_LAG_H
#include "population.h"

typedef struct lag_note { /* what an estimate says of its frame as a whole */
    int64_t age;          /* microseconds since start */
    uint64_t frame;
    double log_evidence;
    int32_t status;
    uint32_t flags;
} lag_note;

typedef struct lag {
    int32_t depth;        /* generations kept, one more than the lag and at least two */
    int32_t room, fields; /* of each */
    lag_note *note;       /* depth; a ring */
    int32_t *count;       /* depth: particles */
    float *value;         /* depth x fields x room, of which fields x count are in use */
    int32_t *parent;      /* depth x room: ancestors in the generation before */
    /* Recomputed in every call. */
    int32_t *who;   /* room: ancestors that still have descendants, */
    double *weight; /* and what these weigh */
} lag;

/* The part that is saved and hashed; then the rest.  frames: how far back estimates reach, 0 for never. */
void lag_layout_state(lag *l, arena *a, int32_t frames, int32_t n, int32_t fields);
void lag_layout_work(lag *l, arena *a);

/* The particles in a slot of the ring, and the slot so many generations before another. */
population lag_people(const lag *l, int32_t slot);
static inline int32_t lag_slot(const lag *l, int32_t slot, int32_t back)
{
    return (slot + l->depth - back) % l->depth;
}

/* Note of the current generation that its estimate is e. */
void lag_keep(gait_tracker *t, const gait_estimate *e);

/* Steps that gait_tracker_lagged() can go back now; -1: none. */
int32_t lag_reach(const gait_tracker *t);

/* Estimate of the frame `back` <= lag_reach() steps ago. */
void lag_estimate(gait_tracker *t, int32_t back, gait_estimate *out);
#endif
