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
    int32_t depth;   /* generations kept, one more than the lag; 0: none */
    lag_note *note;  /* depth; step k lies in slot k % depth */
    float *value;    /* depth x fields x n */
    int32_t *parent; /* depth x n: ancestors in the generation before */
    /* Recomputed in every call. */
    population people; /* ancestors that still have descendants */
    double *weight;    /* n */
} lag;

/* The part that is saved and hashed; then the rest.  frames: how far back estimates reach, 0 for never. */
void lag_layout_state(lag *l, arena *a, int32_t frames, int32_t n, int32_t fields);
void lag_layout_work(lag *l, arena *a, int32_t n, int32_t fields);

/* Keep the current generation, whose estimate is e. */
void lag_keep(gait_tracker *t, const gait_estimate *e);

/* Steps that gait_tracker_lagged() can go back now; -1: none. */
int32_t lag_reach(const gait_tracker *t);

/* Estimate of the frame `back` <= lag_reach() steps ago. */
void lag_estimate(gait_tracker *t, int32_t back, gait_estimate *out);
#endif
