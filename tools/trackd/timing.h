/* timing.h - quantiles of step times, and the latency budget: which frames to drop, how many particles to use. */
#ifndef TRACKD_TIMING_H
#define TRACKD_TIMING_H
#include <stdbool.h>
#include <stdint.h>

/* ---- quantiles of times in fixed memory, exact to 1.6 %. */
enum { HISTOGRAM_BINS = 27 * 64 };

typedef struct histogram { /* all zero: empty */
    int64_t count;
    int32_t largest;
    uint32_t bin[HISTOGRAM_BINS];
} histogram;

/* Add one time in microseconds; negative counts as 0. */
void histogram_add(histogram *h, int64_t us);
/* The value below which `share` of the times lie, microseconds; 0 when empty. */
int32_t histogram_quantile(const histogram *h, double share);

/* ---- latency budget: which frames to drop, and how many particles to use. */
/* Why the number of particles has changed. */
typedef enum budget_reason { BUDGET_SLOW, BUDGET_DROPPED, BUDGET_SPARE } budget_reason;

typedef struct budget {
    int64_t limit_us;     /* from capture to estimate; 0: no limit, every frame is allowed */
    int32_t low, high;    /* range of the number of particles; low 0: it is constant */
    int64_t step_us;      /* running mean of the time of a step */
    int64_t before_us;    /* time of the last step */
    int32_t steps;        /* since the last change or check of `dropped` */
    int32_t dropped;      /* frames since then */
    int32_t refused;      /* frames in a row */
    int32_t calm;         /* steps in a row that took less than a quarter of the limit */
    int32_t slow;         /* steps in a row that took longer than the limit */
    bool hopeless;        /* budget_hopeless() has returned true */
    int32_t failed;       /* this number of particles was too large soon after a doubling; 0: none */
    int32_t patience;     /* grows with every such failure */
    int32_t wait;         /* steps until that number is tried again */
    int32_t trial;        /* steps until the last doubling counts as successful; 0: no trial */
    budget_reason reason; /* of the last change */
    int64_t took_us;      /* time of a step before that change */
    int32_t lost;         /* frames dropped before that change */
    int64_t slow_steps;   /* total */
    int64_t late, over;   /* frames dropped for their age; estimates later than the limit */
} budget;

/* Forget everything but the limits. */
void budget_reset(budget *b);

/* The time from which the age of a frame counts: its capture, or its arrival if the source has another clock (a replay). */
int64_t budget_birth(int64_t capture_utime, int64_t arrival_utime);

/* Whether a frame whose age counts from `birth` can still be tracked in time.  At least a quarter of the limit is
 * reserved for transport.  After a few refusals in a row, any frame no older than the limit is allowed, so that some
 * frames are tracked even if every step is too slow. */
bool budget_allows(budget *b, int64_t birth, int64_t now);

/* A frame was dropped because a newer one has arrived. */
void budget_missed(budget *b);

/* A frame was tracked.  Returns the number of particles to continue with: half as many if steps are slow or frames are
 * dropped; as many as fit into half of the limit after two steps longer than the limit; twice as many after a period of
 * fast steps, which must be longer if that number was too large last time. */
int32_t budget_stepped(budget *b, int64_t birth, int64_t now, int64_t step_us, int32_t particles);

/* Whether steps with this number of particles exceed the limit although it cannot be reduced; true only once. */
bool budget_hopeless(budget *b, int32_t particles);
#endif
