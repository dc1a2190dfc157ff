#include "lift/continue.h"

#include "base/fmath.h"
#include "lift/segment_posterior.h"

#include <string.h>

/* Middle of the markers on the ground. */
static void middle(const double *x, int32_t count, double out[2])
{
    out[0] = out[1] = 0.0;
    for (int32_t j = 0; j < count; j++) {
        out[0] += x[3 * j] / count;
        out[1] += x[3 * j + 1] / count;
    }
}

/* Where every marker begins by the prior alone. */
static void beginning(const lift_table *t, const segment_posterior *b, double *mean)
{
    lift_axes const axes = lift_axes_prior(t, b);
    const float *const m = segment_mean(&t->prior, b->component, 0);
    for (int32_t j = 0; j < t->prior.markers; j++) {
        const double x[3] = {(double)m[3 * j], (double)m[3 * j + 1], (double)m[3 * j + 2]};
        lift_to_world(&axes, x, mean + 3 * j);
    }
}

/* Turn of the trunk about z within `hop` frames, radians: of the lines through hips and shoulders together,
 * because limbs that swing turn most of all. `last`: every marker at its end. */
static double turn_of(const lift_table *t, const segment_posterior *b, const double *last)
{
    double first[6], a[2] = {0.0}, c[2] = {0.0};
    for (const int32_t *pair = t->trunk; pair < t->trunk + 4; pair += 2) {
        if (pair[0] < 0 || pair[1] < 0)
            continue;
        lift_places(t, b, 0.0, pair, 2, first);
        for (int32_t i = 0; i < 2; i++) {
            a[i] += first[3 + i] - first[i];
            c[i] += last[3 * pair[1] + i] - last[3 * pair[0] + i];
        }
    }
    return (double)m_atan2((float)(a[0] * c[1] - a[1] * c[0]), (float)(a[0] * c[0] + a[1] * c[1]));
}

void lift_continue(const lift_table *t, const segment_posterior *before, int32_t c, segment_posterior *next,
                   double *spare)
{
    int32_t const J = t->prior.markers;
    int32_t all[GAIT_MAX_MARKERS];
    double was[2], is[2];
    for (int32_t j = 0; j < J; j++)
        all[j] = j;
    lift_places(t, before, t->prior.hop, all, J, spare);
    middle(spare, J, is);
    next->component = c;
    next->heading = lift_heading(t, before) + (t->turn < 0 ? 0.0 : turn_of(t, before, spare));
    next->centre = next->heading;
    next->turn_sd = t->cfg.turn_sd;
    memcpy(next->place, t->cfg.place, sizeof next->place);
    memset(next->theta, 0, (size_t)t->n * sizeof *next->theta);
    lift_clear(t, next);
    beginning(t, next, spare);
    middle(spare, J, was);
    for (int32_t i = 0; i < 2; i++)
        next->place[i] += is[i] - was[i];
}

double lift_misfit(const lift_table *t, const segment_posterior *b)
{
    double left = b->U[t->n * (t->ld + 1)];
    for (int32_t i = 0; i < t->n; i++)
        left -= b->theta[i] * b->theta[i];
    return left > 0.0 ? left : 0.0;
}
