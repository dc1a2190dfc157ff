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

/* Index of a marker, -1: the prior does not know it. */
static int32_t marker_named(const lift_table *t, const char *name)
{
    for (int32_t j = 0; j < t->prior.markers; j++)
        if (strcmp(t->prior.name[j], name) == 0)
            return j;
    return -1;
}

/* Turn of the trunk about z from x to y, radians: of the lines through hips and shoulders together, because
 * limbs that swing turn most of all. 0 if the prior knows neither. */
static double turn_between(const lift_table *t, const double *x, const double *y)
{
    static const char *const pair[2][2] = {{"r_hip", "l_hip"}, {"r_shoulder", "l_shoulder"}};
    double a[2] = {0.0}, b[2] = {0.0};
    for (int32_t k = 0; k < 2; k++) {
        int32_t const from = marker_named(t, pair[k][0]), to = marker_named(t, pair[k][1]);
        for (int32_t i = 0; from >= 0 && to >= 0 && i < 2; i++) {
            a[i] += x[3 * to + i] - x[3 * from + i];
            b[i] += y[3 * to + i] - y[3 * from + i];
        }
    }
    return (double)m_atan2((float)(a[0] * b[1] - a[1] * b[0]), (float)(a[0] * b[0] + a[1] * b[1]));
}

void lift_continue(const lift_table *t, const lift_belief *before, int32_t c, lift_belief *next,
                   double *first, double *then)
{
    int32_t const J = t->prior.markers;
    double was[2], is[2];
    all_markers(t, before, 0.0, first);
    all_markers(t, before, t->prior.hop, then);
    next->component = c;
    next->heading = lift_heading(t, before) + (t->turn < 0 ? 0.0 : turn_between(t, first, then));
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
