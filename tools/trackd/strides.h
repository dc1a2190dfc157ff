/* strides.h - strides from one estimate after another: a foot strikes where the phase passes 0 (right) or 0.5. */
#ifndef TRACKD_STRIDES_H
#define TRACKD_STRIDES_H
#include "gait.h"

#include <stdbool.h>

enum { STRIDE_RIGHT, STRIDE_LEFT };

typedef struct stride { /* from strike to strike of a foot */
    int64_t utime, start_utime,
        other_utime;                  /* its end; its start; the other foot's strike in between, or -1 */
    float end_sd, start_sd, other_sd; /* standard deviations of these times, seconds; or -1 */
    int side;                         /* STRIDE_RIGHT or STRIDE_LEFT */
    bool sure;                        /* no frame was lost or ambiguous */
    float time, time_sd;              /* seconds */
    float cadence, cadence_sd;        /* steps per minute */
    float length, length_sd;          /* distance of the pelvis over the ground, metres */
    float speed, speed_sd;            /* metres per second */
} stride;

typedef struct stride_point { /* of an estimate, or a strike between two of them */
    double seconds;           /* since the meter's first estimate */
    double late;              /* standard deviation of a strike's time, seconds */
    double place[2], sd[2];   /* pelvis over the ground, metres */
} stride_point;

typedef struct stride_meter {
    bool running;
    int64_t origin_utime;
    double phase;
    stride_point last;
    stride_point strike[2]; /* of the right and left foot */
    bool struck[2];
    bool unsure[2]; /* a frame since that strike was lost or ambiguous */
} stride_meter;

/* Add the next estimate.  True if a stride has ended, which is then in `out`.  After a pause of half a second, a time
 * before the last one, or a jump of the phase, the meter starts again. */
bool stride_meter_add(stride_meter *m, const gait_estimate *e, stride *out);
#endif
