#include "lift/fit.h"

#include "base/fmath.h"

#include <string.h>

enum { SCOUT_PASSES = 5 }; /* of every trial, before the best ones are refined to the end */

static int32_t starts_of(const lift_table *t)
{
    return t->cfg.heading_sd < 0.0 ? LIFT_HEADINGS : 1;
}

void lift_search_layout(arena *a, const lift_table *t, lift_search *s)
{
    int32_t const starts = starts_of(t);
    s->before = TAKE(a, double, (size_t)t->n);
    for (int32_t i = 0; i < t->prior.components * starts; i++)
        s->trial[i].theta = TAKE(a, double, (size_t)t->n);
}

/* Depth at which a body is as large in the picture as these observations: by the scatter of the markers observed. */
static double rough_depth(const lift_table *t, const lift_window *w, const segment_posterior *b)
{
    int32_t const J = t->prior.markers;
    double body = 0.0, picture = 0.0, centre[5] = {0.0}, count = 0.0;
    for (int32_t pass = 0; pass < 2; pass++) {
        for (int32_t f = 0; f < w->frames; f++) {
            lift_observations const observed = {.uv = w->uv + (size_t)(f * J) * 2,
                                                .sd = w->sd + (size_t)f * (size_t)J};
            const float *const mean = segment_mean(&t->prior, b->component, lift_find_moment(t, w->at[f]).f);
            for (int32_t j = 0; j < J; j++) {
                if (!lift_observed_at(&observed, j))
                    continue;
                double const v[5] = {(double)mean[3 * j], (double)mean[3 * j + 1], (double)mean[3 * j + 2],
                                     observed.uv[2 * j] / t->projection.focal[0],
                                     observed.uv[2 * j + 1] / t->projection.focal[1]};
                count += pass == 0;
                for (int32_t i = 0; i < 5; i++) {
                    double const off = v[i] - centre[i];
                    if (pass == 0)
                        centre[i] += off / count; /* running mean */
                    else if (i < 3)
                        body += off * off;
                    else
                        picture += off * off;
                }
            }
        }
    }
    double const depth = t->stature * sqrt(body / (picture > 1e-12 ? picture : 1e-12));
    return depth > 0.5 ? (depth < 1e4 ? depth : 1e4) : 0.5;
}

static void add_window(const lift_table *t, const lift_window *w, segment_posterior *b, double depth)
{
    size_t const J = (size_t)t->prior.markers;
    lift_clear(t, b);
    for (int32_t f = 0; f < w->frames; f++) {
        lift_observations const observed = {.uv = w->uv + (size_t)f * J * 2, .sd = w->sd + (size_t)f * J};
        lift_add(t, b, w->at[f], &observed, NULL, depth);
    }
}

/* Twice the negative log posterior at theta, up to a constant. */
static double objective(const lift_table *t, const segment_posterior *b)
{
    double sum = b->chi2 + b->log_noise;
    for (int32_t i = 0; i < t->n; i++)
        sum += b->theta[i] * b->theta[i];
    return sum;
}

/* The next pass is linearised about the heading found; without a prior it is the centre too. */
static void follow_heading(const lift_table *t, segment_posterior *b)
{
    if (t->turn < 0)
        return;
    b->heading = lift_heading(t, b);
    if (t->cfg.heading_sd < 0.0) {
        b->centre = b->heading;
        b->theta[t->turn] = 0.0;
    }
}

/* Largest change of an unknown from `before`, in standard deviations. */
static double change(const lift_table *t, const segment_posterior *b, const double *before)
{
    double largest = 0.0;
    for (int32_t i = 0; i < t->n; i++) {
        double const d = fabs(b->theta[i] - before[i]);
        largest = d > largest ? d : largest;
    }
    return largest;
}

/* Go back by a share of the way to the pass before, whose objective was lower. */
static void retreat(const lift_table *t, segment_posterior *b, const double *before, double heading,
                    double share)
{
    for (int32_t i = 0; i < t->n; i++)
        b->theta[i] += share * (before[i] - b->theta[i]);
    b->heading += share * (heading - b->heading);
    if (t->turn >= 0 && t->cfg.heading_sd < 0.0)
        b->centre = b->heading;
}

/* Gauss-Newton passes (perspective, unknown heading); a single one if the problem is linear.  first: theta is not yet
 * set.  Passes that end before they converge leave theta where the objective was lowest, because that of the last step
 * has not been evaluated. */
static bool refine(const lift_table *t, const lift_window *w, segment_posterior *b, double *before,
                   bool first, int32_t passes, lift_outcome *out)
{
    bool const linear = !t->projection.perspective && t->turn < 0;
    double lowest = DBL_MAX, noise = 0.0, heading = b->heading;
    out->converged = false;
    for (out->iterations = 0; !out->converged && out->iterations < passes; out->iterations++) {
        bool const rough = first && out->iterations == 0;
        if (rough)
            memset(b->theta, 0, (size_t)t->n * sizeof *b->theta);
        add_window(t, w, b, rough ? (t->projection.perspective ? rough_depth(t, w, b) : 1.0) : 0.0);
        double const now = rough ? DBL_MAX : objective(t, b);
        if (now > lowest + 1e-9 * (1.0 + fabs(lowest))) {
            retreat(t, b, before, heading, 0.5);
            continue;
        }
        lowest = now;
        noise = b->log_noise;
        heading = b->heading;
        memcpy(before, b->theta, (size_t)t->n * sizeof *before);
        if (!lift_solve(t, b))
            return false;
        out->converged = linear || (!rough && change(t, b, before) < t->cfg.tolerance);
        follow_heading(t, b);
    }
    if (!out->converged) { /* chi2 at theta, not as predicted by the linear problem */
        retreat(t, b, before, heading, 1.0);
        b->log_noise = noise;
        b->U[t->n * (t->ld + 1)] = lowest - noise;
    }
    return true;
}

static void load_trial(const lift_table *t, const lift_trial *from, segment_posterior *b)
{
    b->component = from->component;
    b->heading = from->heading;
    b->centre = t->cfg.heading_sd < 0.0 ? from->heading : t->cfg.heading;
    b->turn_sd = t->cfg.heading_sd < 0.0 ? (double)PI_F : t->cfg.heading_sd;
}

/* Refine a trial by some passes and keep the result. */
static bool follow(const lift_table *t, lift_search *s, const lift_window *w, segment_posterior *b,
                   lift_trial *trial, bool first, lift_outcome *out)
{
    load_trial(t, trial, b);
    if (!first)
        memcpy(b->theta, trial->theta, (size_t)t->n * sizeof *b->theta);
    if (!refine(t, w, b, s->before, first, first ? SCOUT_PASSES : t->cfg.max_iterations, out))
        return false;
    trial->evidence = lift_evidence(t, b) + m_log64((double)t->prior.weight[b->component]);
    trial->heading = b->heading;
    memcpy(trial->theta, b->theta, (size_t)t->n * sizeof *b->theta);
    return true;
}

/* Index of the best trial (of `component`, unless negative) except `other`. */
static int32_t best_trial(const lift_search *s, int32_t component, int32_t other)
{
    int32_t best = -1;
    for (int32_t i = 0; i < s->trials; i++)
        if (i != other && (component < 0 || s->trial[i].component == component) &&
            (best < 0 || s->trial[i].evidence > s->trial[best].evidence))
            best = i;
    return best;
}

/* Probability of the component of the best trial; each component counts by its best heading. */
static double share_of(const lift_table *t, const lift_search *s, int32_t best)
{
    double sum = 1.0;
    for (int32_t c = 0; c < t->prior.components; c++)
        if (c != s->trial[best].component)
            sum += m_exp64(s->trial[best_trial(s, c, -1)].evidence - s->trial[best].evidence);
    return 1.0 / sum;
}

bool lift_fit(const lift_table *t, lift_search *s, const lift_window *w, segment_posterior *b,
              lift_outcome *out)
{
    int32_t const starts = starts_of(t);
    s->trials = t->prior.components * starts;
    bool const one = s->trials == 1;
    for (int32_t i = 0; i < s->trials; i++) {
        lift_trial *const trial = &s->trial[i];
        trial->component = i / starts;
        trial->heading = starts == 1 ? t->cfg.heading : (double)TWO_PI_F / LIFT_HEADINGS * (i % starts);
        if (!follow(t, s, w, b, trial, true, out))
            return false;
    }
    int32_t best = best_trial(s, -1, -1);
    int32_t const second = one ? -1 : best_trial(s, -1, best);
    bool const linear = out->converged && starts == 1 && !t->projection.perspective;
    if (!linear && second >= 0 && !follow(t, s, w, b, &s->trial[second], false, out))
        return false;
    if (!one || !linear) {
        if (!follow(t, s, w, b, &s->trial[best], false, out))
            return false;
        int32_t const now = best_trial(s, -1, -1);
        if (now != best && !follow(t, s, w, b, &s->trial[now], false, out))
            return false;
        best = now;
    }
    out->share = share_of(t, s, best);
    return true;
}

bool lift_fit_again(const lift_table *t, lift_search *s, const lift_window *w, segment_posterior *b)
{
    lift_outcome out;
    return refine(t, w, b, s->before, false, t->cfg.max_iterations, &out);
}
