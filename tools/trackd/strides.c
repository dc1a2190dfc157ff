#include "strides.h"

#include <math.h>

static const double TARGET[2] = {0.0, 0.5}; /* phase at which each foot strikes */

static double wrapped(double x) /* into [-0.5, 0.5) */
{
    return x - floor(x + 0.5);
}

static stride_point point_of(const stride_meter *m, const gait_estimate *e)
{
    stride_point p = {.seconds = 1e-6 * (double)(e->utime - m->origin_utime)};
    p.late = (double)e->sd.phase / fmax((double)e->mean.stride_hz, 0.1);
    for (int k = 0; k < 2; k++) {
        p.place[k] = (double)e->pose.joint[0][k]; /* the pelvis is point 0 of every model */
        p.sd[k] = (double)e->joint_sd[0][k];
    }
    return p;
}

static stride_point between(const stride_point *a, const stride_point *b, double share)
{
    stride_point p = {.seconds = a->seconds + share * (b->seconds - a->seconds),
                      .late = a->late + share * (b->late - a->late)};
    for (int k = 0; k < 2; k++) {
        p.place[k] = a->place[k] + share * (b->place[k] - a->place[k]);
        p.sd[k] = a->sd[k] + share * (b->sd[k] - a->sd[k]);
    }
    return p;
}

static int64_t utime_of(const stride_meter *m, const stride_point *p)
{
    return m->origin_utime + llround(1e6 * p->seconds);
}

/* Errors of the two ends are assumed to be independent. */
static stride stride_of(const stride_meter *m, int side, const stride_point *end)
{
    const stride_point *const start = &m->strike[side], *const other = &m->strike[1 - side];
    bool const seen = m->struck[1 - side] && other->seconds > start->seconds;
    double const dx = end->place[0] - start->place[0], dy = end->place[1] - start->place[1];
    double const time = end->seconds - start->seconds, time_sd = hypot(end->late, start->late);
    double const length = hypot(dx, dy), along = fmax(length, 1e-9);
    double const x_sd = hypot(end->sd[0], start->sd[0]), y_sd = hypot(end->sd[1], start->sd[1]);
    double const length_sd = hypot(x_sd * dx, y_sd * dy) / along, speed = length / time;
    return (stride){
        .utime = utime_of(m, end),
        .start_utime = utime_of(m, start),
        .other_utime = seen ? utime_of(m, other) : -1,
        .side = side,
        .sure = !m->unsure[side],
        .end_sd = (float)end->late,
        .start_sd = (float)start->late,
        .other_sd = seen ? (float)other->late : -1.0f,
        .time = (float)time,
        .time_sd = (float)time_sd,
        .cadence = (float)(120.0 / time),
        .cadence_sd = (float)(120.0 / time * time_sd / time),
        .length = (float)length,
        .length_sd = (float)length_sd,
        .speed = (float)speed,
        .speed_sd = (float)(hypot(length_sd, speed * time_sd) / time),
    };
}

/* The foot strikes at `p`, which ends its stride, unless the phase only fluctuates about the strike. */
static bool strike(stride_meter *m, int side, const stride_point *p, double rate, stride *out)
{
    bool const had = m->struck[side];
    if (had && (p->seconds - m->strike[side].seconds) * rate < 0.5)
        return false;
    bool const whole = had && (p->seconds - m->strike[side].seconds) * rate < 1.6; /* no strike was missed */
    if (whole)
        *out = stride_of(m, side, p);
    m->strike[side] = *p;
    m->struck[side] = true;
    m->unsure[side] = false;
    return whole;
}

static void begin(stride_meter *m, const gait_estimate *e)
{
    *m = (stride_meter){.running = true, .origin_utime = e->utime, .phase = (double)e->mean.phase};
    m->last = point_of(m, e);
}

bool stride_meter_add(stride_meter *m, const gait_estimate *e, stride *out)
{
    double const longest = 0.5, limit = 0.25; /* seconds; strides from what the rate predicts */
    stride_point const now = point_of(m, e);
    double const dt = now.seconds - m->last.seconds, turn = wrapped((double)e->mean.phase - m->phase);
    bool found = false;
    if (!m->running || !(dt > 0.0) || dt > longest ||
        fabs(wrapped(turn - (double)e->mean.stride_hz * dt)) > limit) {
        begin(m, e);
        return false;
    }
    for (int side = STRIDE_RIGHT; side <= STRIDE_LEFT; side++) {
        double const ahead = wrapped(TARGET[side] - m->phase);
        m->unsure[side] |= e->status == GAIT_TRACK_LOST || e->status == GAIT_TRACK_AMBIGUOUS;
        if (turn > 0.0 && ahead > 0.0 && ahead <= turn) {
            stride_point const at = between(&m->last, &now, ahead / turn);
            found |= strike(m, side, &at, (double)e->mean.stride_hz, out);
        }
    }
    m->phase = (double)e->mean.phase;
    m->last = now;
    return found;
}
