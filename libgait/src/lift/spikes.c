#include "lift/spikes.h"

#include "base/fmath.h"

static const double LIMIT = 8.0;     /* deviations from the line */
static const double SPREAD = 1.4826; /* median of distances to standard deviation */
static const double PAIR = 1.5;      /* variance of a point off the middle of its neighbours, over its own */
enum { FEWEST = 5 };                 /* detections of a point that tell */

/* Squared distance of a point in frame f from the line through its places in frames a and b, as it would be half way
 * between two neighbours `step` away: further off, or beyond both, noise and acceleration count for more. */
static double off_line(const lift_table *t, const lift_window *w, int32_t j, int32_t a, int32_t f, int32_t b,
                       double step)
{
    double const ahead = w->at[f] - w->at[a], span = w->at[b] - w->at[a], part = ahead / span;
    double const lever = part * (1.0 - part) * (span * span) / (step * step), motion = lever * lever,
                 noise = (1.0 + part * part + (1.0 - part) * (1.0 - part)) / PAIR;
    double sum = 0.0;
    for (int32_t i = 0; i < 2; i++) {
        double const at_a = w->uv[2 * (a * t->prior.markers + j) + i],
                     at_b = w->uv[2 * (b * t->prior.markers + j) + i],
                     off = w->uv[2 * (f * t->prior.markers + j) + i] - (at_a + part * (at_b - at_a));
        sum += off * off;
    }
    return sum / (motion > noise ? motion : noise);
}

static bool there(const lift_table *t, const lift_window *w, const double *sd, int32_t f, int32_t j)
{
    size_t const J = (size_t)t->prior.markers;
    lift_seen const seen = {.uv = w->uv + (size_t)f * J * 2, .sd = sd + (size_t)f * J};
    return lift_seen_at(&seen, j);
}

/* The sight that jumps, by squared distances of which number k is the largest.  Two at an end are as far off whichever of
 * them jumps; the third is off, by half as far, only if it was the second. */
static int32_t culprit(const double *apart, int32_t count, int32_t k)
{
    double const off = apart[k] / 16.0;
    if (k < 2)
        return apart[2] > off;
    if (k > count - 3)
        return count - 1 - (apart[count - 3] > off);
    return k;
}

/* The frame in which a point jumps most, -1: it does not. */
static int32_t worst(const lift_table *t, const lift_window *w, const double *sd, int32_t j,
                     lift_spikes_scratch *room)
{
    int32_t count = 0, far = 0;
    for (int32_t f = 0; f < w->frames; f++)
        if (there(t, w, sd, f, j))
            room->frame[count++] = f;
    if (count < FEWEST)
        return -1;
    double const step = (w->at[room->frame[count - 1]] - w->at[room->frame[0]]) / (count - 1);
    for (int32_t k = 0; k < count; k++) {
        int32_t const before = k > 0 ? k - 1 : 2, after = k < count - 1 ? k + 1 : count - 3;
        room->apart[k] = off_line(t, w, j, room->frame[before], room->frame[k], room->frame[after], step);
        far = room->apart[k] > room->apart[far] ? k : far;
    }
    double const most = room->apart[far];
    far = room->frame[culprit(room->apart, count, far)];
    double const own = sd[far * t->prior.markers + j], least = PAIR * own * own,
                 usual = SPREAD * SPREAD * m_median(room->apart, count);
    return most > LIMIT * LIMIT * (usual > least ? usual : least) ? far : -1;
}

void lift_spikes_clear(const lift_table *t, const lift_window *w, double *sd, lift_spikes_scratch *room)
{
    for (int32_t j = 0; j < t->prior.markers; j++)
        for (int32_t f; (f = worst(t, w, sd, j, room)) >= 0;)
            sd[f * t->prior.markers + j] = -1.0;
}
