#include "lift/robust.h"

#include "base/fmath.h"

#include <string.h>

enum {
    FEWEST = 5, /* observations of a point from which spikes can be found */
    REFITS = 4, /* most fits after the first, while the number of outliers changes */
    ROWS_MOST = (2 * GAIT_MAX_MARKERS + CHOLESKY_FLOATS - 1) / CHOLESKY_FLOATS * CHOLESKY_FLOATS
};

static const double SPIKE = 8.0;        /* standard deviations from the line */
static const double MEDIAN_SD = 1.4826; /* standard deviation over median distance */
static const double LINE_VARIANCE =
    1.5; /* of a point's distance from the middle of its neighbours, over its own */
static const double FAR_SDS =
    4.0; /* standard deviations; fewer than one correct point in 1000 is so far away */
static const double FAR_MEDIAN = 3.0; /* times the median of the frame's points */
static const double POOR_FIT = 4.0;   /* chi2 per observation from which outliers may have misled a search */
static const double ROUGH =
    8.0; /* factor of the points' standard deviations that allows for unusual motions in a rough fit */

/* Squared distance of a point in frame f from the line through its positions in frames a and b, scaled to that of a point
 * half way between two neighbours `step` away: with neighbours further away, or on one side, noise and acceleration have
 * more effect. */
static double off_line(const double *time, const double *uv, int32_t stride, int32_t a, int32_t f, int32_t b,
                       double step)
{
    double const span = time[b] - time[a], share = (time[f] - time[a]) / span;
    double const lever = share * (1.0 - share) * (span * span) / (step * step), motion = lever * lever,
                 noise = (1.0 + share * share + (1.0 - share) * (1.0 - share)) / LINE_VARIANCE;
    double sum = 0.0;
    for (int32_t i = 0; i < 2; i++) {
        double const at_a = uv[a * stride + i], at_b = uv[b * stride + i],
                     off = uv[f * stride + i] - (at_a + share * (at_b - at_a));
        sum += off * off;
    }
    return sum / (motion > noise ? motion : noise);
}

/* The observation that is the spike, if squared distance number k is the largest.  At an end of the track either of the
 * two outer points may be it: both are equally far from the line, but only the inner one also affects the third point,
 * by half as much. */
static int32_t spike_of(const double *square, int32_t count, int32_t k)
{
    double const off = square[k] / 16.0;
    if (k < 2)
        return square[2] > off;
    if (k > count - 3)
        return count - 1 - (square[count - 3] > off);
    return k;
}

/* Frame of the largest spike of a point (uv and sd of every frame `stride` points apart), -1: there is none. */
static int32_t find_spike(int32_t frames, int32_t points, const double *time, const double *uv,
                          const double *sd, double *scratch)
{
    int32_t count = 0, far = 0;
    double *const frame = scratch, *const square = scratch + frames; /* frames exactly, as doubles */
    for (int32_t f = 0; f < frames; f++)
        if (lift_observed(uv + 2 * f * points, sd[f * points]))
            frame[count++] = f;
    if (count < FEWEST)
        return -1;
    double const step = (time[(int32_t)frame[count - 1]] - time[(int32_t)frame[0]]) / (count - 1);
    for (int32_t k = 0; k < count; k++) {
        int32_t const before = k > 0 ? k - 1 : 2, after = k < count - 1 ? k + 1 : count - 3;
        square[k] = off_line(time, uv, 2 * points, (int32_t)frame[before], (int32_t)frame[k],
                             (int32_t)frame[after], step);
        far = square[k] > square[far] ? k : far;
    }
    double const most = square[far];
    far = (int32_t)frame[spike_of(square, count, far)];
    double const own = sd[far * points], least = LINE_VARIANCE * own * own,
                 usual = MEDIAN_SD * MEDIAN_SD * m_median(square, count);
    return most > SPIKE * SPIKE * (usual > least ? usual : least) ? far : -1;
}

int32_t lift_remove_spikes(int32_t frames, int32_t points, const double *time, const double *uv, double *sd,
                           double *scratch)
{
    int32_t spikes = 0;
    for (int32_t j = 0; j < points; j++)
        for (int32_t f; (f = find_spike(frames, points, time, uv + 2 * j, sd + j, scratch)) >= 0; spikes++)
            sd[f * points + j] = -1.0;
    return spikes;
}

int32_t lift_weight_points(int32_t points, const double *square, double *sd, double *scratch)
{
    memcpy(scratch, square, (size_t)points * sizeof *scratch);
    double const usual = FAR_MEDIAN * FAR_MEDIAN * m_median(scratch, points),
                 limit = usual > FAR_SDS * FAR_SDS ? usual : FAR_SDS * FAR_SDS;
    int32_t outliers = 0;
    for (int32_t j = 0; j < points; j++) {
        double const far = square[j] / limit;
        outliers += far > 1.0;
        sd[j] *= far > 1.0 ? far : 1.0;
    }
    return outliers;
}

/* Variances of the white rows t->W as a posterior predicts them, over those of their noise. */
static void predict(const lift_table *t, const segment_posterior *b, int32_t rows, double *variance)
{
    int32_t const width = cholesky_padded_float(rows);
    memset(variance, 0, (size_t)width * sizeof *variance);
    for (int32_t i = 0; i < t->ld; i++)
        for (int32_t r = 0; r < width; r++)
            t->V[i * width + r] = i < t->n && r < rows ? (float)t->W[r * t->ld + i] : 0.0f;
    t->run->cholesky_forward_float(b->U, t->n, t->ld, t->V, width);
    t->run->lift_squares(variance, width, t->V, (size_t)width, t->n);
}

/* The largest of the points' squares, two rows each. */
static double largest(const double *square, int32_t rows)
{
    double most = 0.0;
    for (int32_t r = 0; r < rows; r += 2)
        most = square[r] + square[r + 1] > most ? square[r] + square[r + 1] : most;
    return most;
}

/* Replace the squares of the rows by those of the points, two rows each, at the front. */
static void join(int32_t rows, const double *variance, double *square)
{
    for (int32_t r = 0; r < rows; r += 2)
        square[r / 2] = square[r] / (1.0 + variance[r]) + square[r + 1] / (1.0 + variance[r + 1]);
}

int32_t lift_weight_frame(const lift_table *t, const segment_posterior *b, double at,
                          const lift_observations *observed, bool known, double *position, double *sd)
{
    double square[2 * GAIT_MAX_MARKERS], own[GAIT_MAX_MARKERS], sorted[GAIT_MAX_MARKERS],
        variance[ROWS_MOST] = {0.0};
    segment_posterior unchanged = *b;
    lift_residuals const residuals = {.position = position, .square = square};
    int32_t const rows = lift_rows(t, &unchanged, at, observed, NULL, 0.0, &residuals), J = t->prior.markers;
    int32_t count = 0, next = 0;
    memcpy(sd, observed->sd, (size_t)J * sizeof *sd);
    if (largest(square, rows) <= FAR_SDS * FAR_SDS)
        return 0;
    if (!known)
        predict(t, b, rows, variance);
    join(rows, variance, square);
    for (int32_t j = 0; j < J; j++)
        if (lift_observed_at(observed, j))
            own[count++] = sd[j];
    int32_t const outliers = lift_weight_points(count, square, own, sorted);
    for (int32_t j = 0; j < J; j++)
        if (lift_observed_at(observed, j))
            sd[j] = own[next++];
    return outliers;
}

/* Set the standard deviations of a window's points by a fit to them; returns how many are outliers. */
static int32_t weight_window(const lift_table *t, const lift_window *w, const lift_robust *r,
                             const segment_posterior *b)
{
    size_t const J = (size_t)t->prior.markers;
    int32_t outliers = 0;
    for (int32_t f = 0; f < w->frames; f++) {
        lift_observations const observed = {.uv = w->uv + (size_t)f * J * 2,
                                            .sd = r->inlier_sd + (size_t)f * J};
        outliers += lift_weight_frame(t, b, w->at[f], &observed, true, r->position, r->sd + (size_t)f * J);
    }
    return outliers;
}

/* Search with all points, their standard deviations multiplied by `times`, and refit while the outliers change. */
static bool fit_from(const lift_table *t, lift_search *s, const lift_window *w, const lift_robust *r,
                     double times, segment_posterior *b, lift_outcome *out, int32_t *outliers)
{
    int32_t before = times > 1.0 ? -1 : 0; /* a rough fit is never the last */
    for (size_t i = 0; i < (size_t)w->frames * (size_t)t->prior.markers; i++)
        r->sd[i] = times * r->inlier_sd[i];
    bool ok = lift_fit(t, s, w, b, out);
    *outliers = ok ? weight_window(t, w, r, b) : 0;
    for (int32_t fits = 0; ok && *outliers != before && fits < REFITS; fits++) {
        before = *outliers;
        ok = lift_fit_again(t, s, w, b);
        *outliers = ok ? weight_window(t, w, r, b) : 0;
    }
    return ok;
}

bool lift_fit_robust(const lift_table *t, lift_search *s, const lift_window *w, const lift_robust *r,
                     segment_posterior *b, lift_outcome *out, int32_t *outliers)
{
    bool ok = fit_from(t, s, w, r, 1.0, b, out, outliers);
    if (!ok || (*outliers == 0 && lift_chi2(t, b) <= POOR_FIT * b->observed))
        return ok;
    double const usual = lift_evidence(t, b);
    ok = fit_from(t, s, w, r, ROUGH, b, out, outliers);
    if (ok && lift_evidence(t, b) < usual) /* the first fit was overwritten: there is memory for one */
        ok = fit_from(t, s, w, r, 1.0, b, out, outliers);
    return ok;
}
