/* arming.h - from which frame on to track: a start waits here until the stream reaches it. */
#ifndef TOOLS_ARMING_H
#define TOOLS_ARMING_H
#include "image_view.h"
#include "init_file.h"

typedef struct arming {
    bool armed;
    gait_state mean, sd;
    int64_t frame;                  /* start at the frame of this number; -1: by time */
    int64_t utime;                  /* start at this capture time; 0: at the next frame */
    int64_t last_frame, last_utime; /* of the last frame before; -1: none yet */
    int64_t received;               /* frames, for sources that do not count */
} arming;

typedef enum arming_answer { ARMING_WAIT, ARMING_START, ARMING_MISSED } arming_answer;

void arming_by_file(arming *a, const init_state *init);
void arming_by_time(arming *a, const gait_state *mean, const gait_state *sd, int64_t utime);
/* Has the stream reached the start?  Then `utime` is the capture time at which the state holds.  ARMING_MISSED: the
 * stream began more than `max_gap` seconds too late. */
arming_answer arming_reached(arming *a, const image_view *frame, double max_gap, int64_t *utime,
                             message *why);
#endif
