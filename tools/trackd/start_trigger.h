/* start_trigger.h - from which frame on to track: a start waits here until the stream reaches it. */
#ifndef TRACKD_START_TRIGGER_H
#define TRACKD_START_TRIGGER_H
#include "image_view.h"
#include "init_file.h"

typedef struct start_trigger {
    bool armed;
    gait_state mean, sd;
    int64_t frame;                  /* start at the frame of this number; -1: by time */
    int64_t utime;                  /* start at this capture time; 0: at the next frame */
    int64_t last_frame, last_utime; /* of the last frame before; -1: none yet */
    int64_t received;               /* frames, for sources that do not count */
} start_trigger;

typedef enum start_trigger_answer { START_TRIGGER_WAIT, START_TRIGGER_START, START_TRIGGER_MISSED } start_trigger_answer;

void start_trigger_by_file(start_trigger *a, const init_state *init);
void start_trigger_by_time(start_trigger *a, const gait_state *mean, const gait_state *sd, int64_t utime);
/* Has the stream reached the start?  Then `utime` is the capture time at which the state holds.  START_TRIGGER_MISSED: the
 * stream began more than `max_gap` seconds too late. */
start_trigger_answer start_trigger_reached(start_trigger *a, const image_view *frame, double max_gap, int64_t *utime,
                             message *why);
#endif
