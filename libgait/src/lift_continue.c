#include "lift_continue.h"

#include "fmath.h"
#include "lift.h"

#include <string.h>

static void all_markers(const lift_table *t, const lift_belief *b, double at, double *mean)
{
    int32_t all[GAIT_MAX_MARKERS];
    for (int32_t j = 0; j < t->prior.markers; j++)
        all[j] = j;
    lift_query const q = {.at = at, .marker = all, .count = t->prior.markers};
    lift_read(t, b, &q, mean, NULL);
}

/* Middle of the markers on the ground. */
static void middle(const double *x, int32_t count, double out[2])
{
    out[0] = out[1] = 0.0;
    for (int32_t j = 0; j < count; j++) {
        out[0] += x[3 * j] / count;
        out[1] += x[3 * j + 1] / count;
    }
}

/* Turn about z that takes x to y best, their middles aside (least squares), radians. */
static double turn_between(const double *x, const double *y, int32_t count)
{
    double a[2], b[2], along = 0.0, across = 0.0;
    middle(x, count, a);
    middle(y, count, b);
    for (int32_t j = 0; j < count; j++) {
        double const px = x[3 * j] - a[0], py = x[3 * j + 1] - a[1];
        double const qx = y[3 * j] - b[0], qy = y[3 * j + 1] - b[1];
        along += px * qx + py * qy;
        across += px * qy - py * qx;
    }
    return (double)m_atan2((float)across, (float)along);
}

void lift_continue(const lift_table *t, const lift_belief *before, int32_t c, lift_belief *next,
                   double *first, double *then)
{
    int32_t const J = t->prior.markers;
    double was[2], is[2];
    all_markers(t, before, 0.0, first);
    all_markers(t, before, t->prior.hop, then);
    next->component = c;
    next->heading = lift_heading(t, before) + (t->turn < 0 ? 0.0 : turn_between(first, then, J));
    next->centre = next->heading;
    next->turn_sd = t->cfg.turn_sd;
    memcpy(next->place, t->cfg.place, sizeof next->place);
    memset(next->theta, 0, (size_t)t->n * sizeof *next->theta);
    lift_clear(t, next);
    all_markers(t, next, 0.0, first);
    middle(then, J, is);
    middle(first, J, was);
    for (int32_t i = 0; i < 2; i++)
        next->place[i] += is[i] - was[i];
}

double lift_misfit(const lift_table *t, const lift_belief *b)
{
    double left = b->U[t->n * (t->ld + 1)];
    for (int32_t i = 0; i < t->n; i++)
        left -= b->theta[i] * b->theta[i];
    return left > 0.0 ? left : 0.0;
}
