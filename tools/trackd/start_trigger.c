#include "start_trigger.h"

#include <inttypes.h>

void start_trigger_by_file(start_trigger *a, const init_state *init)
{
    *a = (start_trigger){.armed = true, .mean = init->mean, .sd = init->sd, .frame = init->frame, .last_frame = -1};
}

void start_trigger_by_time(start_trigger *a, const gait_state *mean, const gait_state *sd, int64_t utime)
{
    *a = (start_trigger){.armed = true, .mean = *mean, .sd = *sd, .frame = -1, .utime = utime, .last_frame = -1};
}

/* Capture time of the wanted frame when it was lost: between its neighbours, evenly. */
static start_trigger_answer lost_frame(const start_trigger *a, int64_t number, int64_t frame_utime, int64_t *utime,
                                message *why)
{
    if (a->last_frame < 0) {
        message_set(why,
                    "the stream began at frame %" PRId64 ", the start is for frame %" PRId64
                    ": begin it earlier or send START",
                    number, a->frame);
        return START_TRIGGER_MISSED;
    }
    double const share = (double)(a->frame - a->last_frame) / (double)(number - a->last_frame);
    *utime = a->last_utime + (int64_t)(share * (double)(frame_utime - a->last_utime));
    return START_TRIGGER_START;
}

static start_trigger_answer by_number(start_trigger *a, const image_view *frame, int64_t *utime, message *why)
{
    int64_t const number = frame->frame >= 0 ? frame->frame : a->received++;
    if (number == a->frame) {
        *utime = frame->utime;
        return START_TRIGGER_START;
    }
    if (number > a->frame)
        return lost_frame(a, number, frame->utime, utime, why);
    a->last_frame = number;
    a->last_utime = frame->utime;
    return START_TRIGGER_WAIT;
}

start_trigger_answer start_trigger_reached(start_trigger *a, const image_view *frame, double max_gap, int64_t *utime, message *why)
{
    start_trigger_answer answer = START_TRIGGER_START;
    *utime = a->utime ? a->utime : frame->utime;
    if (a->frame >= 0)
        answer = by_number(a, frame, utime, why);
    else if (frame->utime < a->utime)
        answer = START_TRIGGER_WAIT;
    double const late = (double)(frame->utime - *utime) * 1e-6;
    if (answer == START_TRIGGER_START && late > max_gap) {
        message_set(why,
                    "the first frame is %.3f s later than the start: begin the stream earlier or send START",
                    late);
        answer = START_TRIGGER_MISSED;
    }
    a->armed = answer == START_TRIGGER_WAIT;
    return answer;
}
