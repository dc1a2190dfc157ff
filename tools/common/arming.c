#include "arming.h"

#include <inttypes.h>

void arming_by_file(arming *a, const init_state *init)
{
    *a = (arming){.armed = true, .mean = init->mean, .sd = init->sd, .frame = init->frame, .last_frame = -1};
}

void arming_by_time(arming *a, const gait_state *mean, const gait_state *sd, int64_t utime)
{
    *a = (arming){.armed = true, .mean = *mean, .sd = *sd, .frame = -1, .utime = utime, .last_frame = -1};
}

/* Capture time of the wanted frame when it was lost: between its neighbours, evenly. */
static arming_answer lost_frame(const arming *a, int64_t number, int64_t frame_utime, int64_t *utime,
                                message *why)
{
    if (a->last_frame < 0) {
        message_set(why,
                    "the stream began at frame %" PRId64 ", the start is for frame %" PRId64
                    ": begin it earlier or send START",
                    number, a->frame);
        return ARMING_MISSED;
    }
    double const share = (double)(a->frame - a->last_frame) / (double)(number - a->last_frame);
    *utime = a->last_utime + (int64_t)(share * (double)(frame_utime - a->last_utime));
    return ARMING_START;
}

static arming_answer by_number(arming *a, const image_view *frame, int64_t *utime, message *why)
{
    int64_t const number = frame->frame >= 0 ? frame->frame : a->received++;
    if (number == a->frame) {
        *utime = frame->utime;
        return ARMING_START;
    }
    if (number > a->frame)
        return lost_frame(a, number, frame->utime, utime, why);
    a->last_frame = number;
    a->last_utime = frame->utime;
    return ARMING_WAIT;
}

arming_answer arming_reached(arming *a, const image_view *frame, double max_gap, int64_t *utime, message *why)
{
    arming_answer answer = ARMING_START;
    *utime = a->utime ? a->utime : frame->utime;
    if (a->frame >= 0)
        answer = by_number(a, frame, utime, why);
    else if (frame->utime < a->utime)
        answer = ARMING_WAIT;
    double const late = (double)(frame->utime - *utime) * 1e-6;
    if (answer == ARMING_START && late > max_gap) {
        message_set(why,
                    "the first frame is %.3f s later than the start: begin the stream earlier or send START",
                    late);
        answer = ARMING_MISSED;
    }
    a->armed = answer == ARMING_WAIT;
    return answer;
}
