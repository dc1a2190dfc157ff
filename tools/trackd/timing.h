/* timing.h - quantiles of step times, and the latency budget: which frames are dropped, how many particles are used. */
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

/* ---- how old an estimate may be: which frames are dropped for it, and how many particles keep it. */
/* Why the number of particles has changed. */
typedef enum budget_reason { BUDGET_SLOW, BUDGET_DROPPED, BUDGET_SPARE } budget_reason;

typedef struct budget {
    int64_t limit_us;     /* from capture to estimate; 0: none, and every frame is allowed */
    int32_t low, high;    /* particles between which it chooses; low 0: their number stays */
    int64_t step_us;      /* what a step has taken lately */
    int64_t before_us;    /* what the last step took */
    int32_t steps;        /* since the last choice or look at `dropped` */
    int32_t dropped;      /* frames since then */
    int32_t refused;      /* frames in a row */
    int32_t calm;         /* steps in a row that took less than a quarter of the limit */
    int32_t slow;         /* steps in a row that alone took longer than the limit */
    bool hopeless;        /* so many that it was said */
    int32_t failed;       /* so many particles were too many soon after a doubling; 0: none were */
    int32_t patience;     /* grows with every such failure */
    int32_t wait;         /* steps before so many are tried again */
    int32_t trial;        /* steps until the last doubling is held to be right; 0: none is on trial */
    budget_reason reason; /* of the last change, */
    int64_t took_us;      /* what a step took before it, */
    int32_t lost;         /* and the frames dropped */
    int64_t slow_steps;   /* all of them */
    int64_t late, over;   /* frames dropped for their age; estimates that came later than the limit */
} budget;

/* As at the program's start: only the limits are kept. */
void budget_reset(budget *b);

/* Since when a frame is old: its capture; or, where its source has another clock (a replay), its arrival. */
int64_t budget_birth(int64_t capture_utime, int64_t arrival_utime);

/* Can a frame that was born at `birth` still be tracked in time?  At least a quarter of the limit is left for the
 * way to here, and after a few frames refused in a row one is tried that is not older than the limit itself, so that
 * something is tracked even where a step takes longer. */
bool budget_allows(budget *b, int64_t birth, int64_t now);

/* A frame was dropped because another waits behind it. */
void budget_missed(budget *b);

/* A frame was tracked.  Returns the number of particles to go on with: half as many when steps are slow or frames are
 * dropped, as many as take half of the limit after two steps that took longer than it, twice as many after a while
 * with time to spare, a longer while if so many were too many the last time. */
int32_t budget_stepped(budget *b, int64_t birth, int64_t now, int64_t step_us, int32_t particles);

/* Do steps with so many particles take longer than the limit, and may their number not fall?  true only once. */
bool budget_hopeless(budget *b, int32_t particles);
#endif
