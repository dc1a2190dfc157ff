#include "lift/stream.h"

#include "base/fmath.h"

#include <string.h>

static const double LEAST_LAG_FPS = 10.0; /* frames per second down to which `lag` frames are kept */
static const double MANY_OUTLIERS =
    0.25; /* share of outliers among a segment's numbers from which the segment is wrong, not the points */
static const double FIRST =
    0.5; /* factor of the fit threshold for the first segment, which no other one confirms */

static stream_segment *segment_at(const lift_stream *s, int64_t index)
{
    return &s->segment[index % s->segments];
}

/* Index of the oldest segment that is kept. */
static int64_t oldest_segment(const lift_stream *s)
{
    return s->next > s->segments ? s->next - s->segments : 0;
}

static size_t ring_index(const lift_stream *s, uint64_t frame)
{
    return (size_t)(frame % (uint64_t)s->past.capacity);
}

/* Observations of a frame, with outliers down-weighted. */
static lift_observations weighted_frame(const lift_table *t, const lift_stream *s, uint64_t frame)
{
    size_t const i = ring_index(s, frame), J = (size_t)t->prior.markers;
    return (lift_observations){.uv = s->past.uv + i * J * 2, .sd = s->past.sd + i * J};
}

/* Observations of a frame, with the standard deviations as observed. */
static lift_observations raw_frame(const lift_table *t, const lift_stream *s, uint64_t frame)
{
    lift_observations observed = weighted_frame(t, s, frame);
    observed.sd = s->past.raw + ring_index(s, frame) * (size_t)t->prior.markers;
    return observed;
}

static uint64_t oldest_frame(const lift_stream *s)
{
    uint64_t const capacity = (uint64_t)s->past.capacity;
    return s->pushed > capacity ? s->pushed - capacity : 0;
}

/* Seconds since the stream's origin. */
static double time_of(const lift_stream *s, uint64_t frame)
{
    return 1e-6 * (double)(s->past.utime[ring_index(s, frame)] - s->origin);
}

static bool covers(const lift_stream *s, int64_t index, double time)
{
    double const since = time - (double)index * s->step;
    return since >= -1e-9 && since <= s->span + 1e-9;
}

/* Moment of a frame in a segment, in frames of the prior. */
static double moment_of(const lift_table *t, const lift_stream *s, int64_t index, uint64_t frame)
{
    return (time_of(s, frame) - (double)index * s->step) * (double)t->prior.fps;
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

/* Positions of the markers in the first frame by the prior alone. */
static void prior_positions(const lift_table *t, const segment_posterior *b, double *mean)
{
    lift_axes const axes = lift_axes_prior(t, b);
    const float *const m = segment_mean(&t->prior, b->component, 0);
    for (int32_t j = 0; j < t->prior.markers; j++) {
        const double x[3] = {(double)m[3 * j], (double)m[3 * j + 1], (double)m[3 * j + 2]};
        lift_to_world(&axes, x, mean + 3 * j);
    }
}

/* Turn of the trunk about z within `hop` frames, radians: of the lines through hips and shoulders together, because
 * swinging limbs turn more than the body.  last: every marker after `hop` frames. */
static double turn_of(const lift_table *t, const segment_posterior *b, const double *last)
{
    double first[6], a[2] = {0.0}, c[2] = {0.0};
    for (const int32_t *pair = t->trunk; pair < t->trunk + 4; pair += 2) {
        if (pair[0] < 0 || pair[1] < 0)
            continue;
        lift_positions(t, b, 0.0, pair, 2, first);
        for (int32_t i = 0; i < 2; i++) {
            a[i] += first[3 + i] - first[i];
            c[i] += last[3 * pair[1] + i] - last[3 * pair[0] + i];
        }
    }
    return (double)m_atan2((float)(a[0] * c[1] - a[1] * c[0]), (float)(a[0] * c[0] + a[1] * c[1]));
}

/* Prior of component c of the next segment, from the segment before at its frame `hop`: the heading turned as far as the
 * body has turned, the body's middle where it is then.  spare: J x 3. */
static void continue_from(const lift_table *t, const segment_posterior *before, int32_t c,
                          segment_posterior *next, double *spare)
{
    int32_t const J = t->prior.markers;
    int32_t all[GAIT_MAX_MARKERS];
    double was[2], is[2];
    for (int32_t j = 0; j < J; j++)
        all[j] = j;
    lift_positions(t, before, t->prior.hop, all, J, spare);
    middle(spare, J, is);
    next->component = c;
    next->heading = lift_heading(t, before) + (t->turn < 0 ? 0.0 : turn_of(t, before, spare));
    next->centre = next->heading;
    next->turn_sd = t->cfg.turn_sd;
    memcpy(next->place, t->cfg.place, sizeof next->place);
    memset(next->theta, 0, (size_t)t->n * sizeof *next->theta);
    lift_clear(t, next);
    prior_positions(t, next, spare);
    middle(spare, J, was);
    for (int32_t i = 0; i < 2; i++)
        next->place[i] += is[i] - was[i];
}

static int32_t round_up(double x)
{
    return (int32_t)x + ((double)(int32_t)x < x);
}

void lift_stream_layout(arena *a, const lift_table *t, lift_stream *s)
{
    const segment_prior *const p = &t->prior;
    size_t const J = (size_t)p->markers, K = (size_t)p->components;
    s->span = (double)(p->frames - 1) / (double)p->fps;
    s->step = (double)p->hop / (double)p->fps;
    s->past.capacity = i_max(round_up(s->span * t->cfg.max_rate) + 2, t->cfg.lag + 1);
    s->segments =
        round_up((double)p->frames / (double)p->hop) + round_up(t->cfg.lag / LEAST_LAG_FPS / s->step) + 1;
    size_t const capacity = (size_t)s->past.capacity;
    s->past.utime = TAKE(a, int64_t, capacity);
    s->past.uv = TAKE(a, double, capacity * J * 2);
    s->past.sd = TAKE(a, double, capacity *J);
    s->past.raw = TAKE(a, double, capacity *J);
    s->at = TAKE(a, double, capacity);
    s->uv = TAKE(a, double, capacity * J * 2);
    s->guess = TAKE(a, double, J * 3);
    s->robust = (lift_robust){
        .sd = TAKE(a, double, capacity *J), .inlier_sd = TAKE(a, double, capacity *J), .position = s->guess};
    s->scratch = TAKE(a, double, capacity * 2);
    s->mean = TAKE(a, double, J * 3);
    s->sd = TAKE(a, double, J * 3);
    s->new_uv = TAKE(a, double, J * 2);
    s->new_sd = TAKE(a, double, J);
    s->segment = TAKE(a, stream_segment, (size_t)s->segments);
    for (int32_t i = 0; i < s->segments; i++) {
        segment_posterior *const posterior = TAKE(a, segment_posterior, K);
        if (s->segment)
            s->segment[i].posterior = posterior;
        for (size_t c = 0; c < K; c++) {
            segment_posterior placed;
            segment_posterior_layout(a, t, &placed);
            if (posterior)
                posterior[c] = placed;
        }
    }
}

void lift_stream_reset(lift_stream *s)
{
    s->pushed = 0;
    s->origin = s->last = -1;
    s->next = 0;
    s->poor_fit = false;
}

static void keep_frame(const lift_table *t, lift_stream *s, int64_t utime, const lift_observations *observed)
{
    size_t const i = ring_index(s, s->pushed), J = (size_t)t->prior.markers;
    s->past.utime[i] = s->last = utime;
    memcpy(s->past.uv + i * J * 2, observed->uv, J * 2 * sizeof(double));
    memcpy(s->past.sd + i * J, observed->sd, J * sizeof(double));
    memcpy(s->past.raw + i * J, observed->sd, J * sizeof(double));
    s->pushed++;
}

/* Add a frame to every component of a segment, linearised about the guess. */
static void add_frame(const lift_table *t, const lift_stream *s, stream_segment *segment, uint64_t frame)
{
    lift_observations const observed = weighted_frame(t, s, frame), raw = raw_frame(t, s, frame);
    for (int32_t c = 0; c < t->prior.components; c++)
        lift_add(t, &segment->posterior[c], moment_of(t, s, segment->index, frame), &observed, s->guess, 0.0);
    for (int32_t j = 0; j < t->prior.markers; j++)
        segment->outliers += lift_observed_at(&raw, j) && observed.sd[j] > raw.sd[j] ? 2 : 0;
}

/* Set the standard deviations of the newest frame's points by a segment's prediction, which s->guess receives. */
static void weight_frame(const lift_table *t, lift_stream *s, const stream_segment *segment)
{
    uint64_t const frame = s->pushed - 1;
    lift_observations const observed = raw_frame(t, s, frame);
    (void)lift_weight_frame(t, &segment->posterior[segment->best], moment_of(t, s, segment->index, frame),
                            &observed, false, s->guess,
                            s->past.sd + ring_index(s, frame) * (size_t)t->prior.markers);
}

static bool solve_segment(const lift_table *t, stream_segment *segment)
{
    double best = -DBL_MAX;
    bool ok = true;
    for (int32_t c = 0; c < t->prior.components; c++) {
        segment_posterior *const b = &segment->posterior[c];
        ok &= lift_solve(t, b);
        if (t->prior.components == 1 || !ok)
            continue;
        double const evidence = lift_evidence(t, b) + m_log64((double)t->prior.weight[c]);
        if (evidence > best) {
            best = evidence;
            segment->best = c;
        }
    }
    return ok;
}

/* Positions of the markers observed in a frame by a segment: s->guess. */
static void guess_frame(const lift_table *t, lift_stream *s, const stream_segment *segment, uint64_t frame)
{
    lift_observations const observed = weighted_frame(t, s, frame);
    int32_t marker[GAIT_MAX_MARKERS], count = 0;
    for (int32_t j = 0; j < t->prior.markers; j++)
        if (lift_observed_at(&observed, j))
            marker[count++] = j;
    lift_positions(t, &segment->posterior[segment->best], moment_of(t, s, segment->index, frame), marker,
                   count, s->mean);
    for (int32_t r = 0; r < count; r++)
        memcpy(s->guess + 3 * marker[r], s->mean + 3 * r, 3 * sizeof *s->mean);
}

/* Whether so many points are outliers that the segment must be wrong. */
static bool mostly_outliers(const stream_segment *segment)
{
    return segment->outliers > MANY_OUTLIERS * segment->posterior[segment->best].observed;
}

/* Begin segment `index` where the one before it predicts the body, and add the frames that it covers. */
static bool open_segment(const lift_table *t, lift_stream *s, int64_t index)
{
    const stream_segment *const before = segment_at(s, index - 1);
    stream_segment *const segment = segment_at(s, index);
    *segment = (stream_segment){.index = index, .best = before->best, .posterior = segment->posterior};
    for (int32_t c = 0; c < t->prior.components; c++)
        continue_from(t, &before->posterior[before->best], c, &segment->posterior[c], s->guess);
    for (uint64_t f = oldest_frame(s); f < s->pushed; f++) {
        if (!covers(s, index, time_of(s, f)))
            continue;
        guess_frame(t, s, before, f);
        add_frame(t, s, segment, f);
    }
    return solve_segment(t, segment);
}

/* Begin all segments that start before or at the newest frame. */
static bool open_segments(const lift_table *t, lift_stream *s)
{
    double const now = time_of(s, s->pushed - 1);
    bool ok = true;
    while (ok && (double)s->next * s->step <= now + 1e-9)
        ok = open_segment(t, s, s->next++);
    return ok;
}

/* Whether a segment contradicts the observations and may be searched for again.  share: factor of the fit threshold. */
static bool contradicts(const lift_table *t, const stream_segment *segment, double share)
{
    const segment_posterior *const b = &segment->posterior[segment->best];
    bool const wrong =
        lift_chi2(t, b) > share * t->cfg.fit_threshold * b->observed || mostly_outliers(segment);
    return wrong && t->cfg.fit_threshold > 0.0 && t->cfg.heading_sd < 0.0;
}

/* Search for segment `index`: a robust fit to all frames that it covers, independent of its posterior so far.  false:
 * numbers out of range. */
static bool refit_segment(const lift_table *t, lift_search *search, lift_stream *s, int64_t index)
{
    size_t const J = (size_t)t->prior.markers;
    stream_segment *const segment = segment_at(s, index);
    segment_posterior *const b = &segment->posterior[0];
    lift_window w = {.at = s->at, .uv = s->uv, .sd = s->robust.sd};
    lift_outcome outcome;
    int32_t outliers;
    for (uint64_t f = oldest_frame(s); f < s->pushed; f++) {
        lift_observations const observed = raw_frame(t, s, f);
        if (!covers(s, index, time_of(s, f)))
            continue;
        s->at[w.frames] = moment_of(t, s, index, f);
        memcpy(s->uv + (size_t)w.frames * J * 2, observed.uv, J * 2 * sizeof(double));
        memcpy(s->robust.inlier_sd + (size_t)w.frames * J, observed.sd, J * sizeof(double));
        w.frames++;
    }
    (void)lift_remove_spikes(w.frames, t->prior.markers, w.at, w.uv, s->robust.inlier_sd, s->scratch);
    memcpy(b->place, t->cfg.place, sizeof b->place);
    if (!lift_fit_robust(t, search, &w, &s->robust, b, &outcome, &outliers))
        return false;
    const double *sd = w.sd; /* the frames keep the standard deviations of this fit */
    for (uint64_t f = oldest_frame(s); f < s->pushed; f++)
        if (covers(s, index, time_of(s, f))) {
            memcpy(s->past.sd + ring_index(s, f) * J, sd, J * sizeof *sd);
            sd += J;
        }
    int32_t const c = b->component;
    if (c != 0) { /* every component has a posterior of its own */
        segment_posterior const found = *b;
        segment->posterior[0] = segment->posterior[c];
        segment->posterior[c] = found;
    }
    segment->index = index;
    segment->best = c;
    segment->outliers = 2 * outliers;
    segment->closed = true; /* the other components are not continued in this segment */
    return true;
}

/* Close a segment that has ended.  If it has no observations, the stream starts anew with the next person; if it does not
 * fit, it is searched for, and those after it begin again. */
static bool close_segment(const lift_table *t, lift_search *search, lift_stream *s, stream_segment *segment)
{
    segment->closed = true;
    if (segment->posterior[segment->best].observed == 0) {
        lift_stream_reset(s);
        return true;
    }
    s->poor_fit = contradicts(t, segment, 1.0);
    if (!s->poor_fit)
        return true;
    bool ok = refit_segment(t, search, s, segment->index);
    int64_t const opened = s->next;
    for (s->next = segment->index + 1; ok && s->next < opened; s->next++)
        ok = open_segment(t, s, s->next);
    return ok;
}

/* Add the newest frame to the segments that cover it.  The oldest of them predicts the points and decides which are
 * outliers; all segments are linearised about that prediction. */
static bool follow(const lift_table *t, lift_search *search, lift_stream *s)
{
    uint64_t const frame = s->pushed - 1;
    double const now = time_of(s, frame);
    bool ok = true, first = true;
    for (int64_t i = oldest_segment(s); ok && i < s->next; i++) {
        stream_segment *const segment = segment_at(s, i);
        if (segment->closed)
            continue;
        if (!covers(s, i, now)) {
            ok = close_segment(t, search, s, segment);
            if (s->origin < 0 || s->poor_fit)
                return ok; /* the segments began again, with this frame, or the stream did, without a person */
            continue;
        }
        if (first)
            weight_frame(t, s, segment);
        add_frame(t, s, segment, frame);
        ok = ok && solve_segment(t, segment);
        first = false;
    }
    return ok;
}

/* Fit the first segment once it is complete; a poor fit is flagged.  If too many points are outliers, the segment begins
 * with the next frame instead. */
static bool begin(const lift_table *t, lift_search *search, lift_stream *s)
{
    if (time_of(s, s->pushed - 1) < s->span - 1e-9)
        return true;
    if (!refit_segment(t, search, s, 0))
        return false;
    stream_segment *const first = segment_at(s, 0);
    s->next = !mostly_outliers(first);
    s->poor_fit = contradicts(t, first, FIRST);
    for (uint64_t f = oldest_frame(s); !s->next && f < s->pushed; f++)
        if (time_of(s, f) > 0.0) {
            s->origin = s->past.utime[ring_index(s, f)];
            break;
        }
    return true;
}

static bool any_observed(const lift_table *t, const lift_observations *observed)
{
    bool any = false;
    for (int32_t j = 0; j < t->prior.markers; j++)
        any |= lift_observed_at(observed, j);
    return any;
}

bool lift_stream_push(const lift_table *t, lift_search *search, lift_stream *s, int64_t utime,
                      const lift_observations *observed)
{
    if (s->last >= 0 && (double)(utime - s->last) > 1e6 * t->cfg.max_gap)
        lift_stream_reset(s);
    if (s->origin < 0) {
        s->pushed = 0;
        s->last = utime;
        if (!any_observed(t, observed))
            return true;
        s->origin = utime;
    }
    keep_frame(t, s, utime, observed);
    bool ok = s->next == 0 ? begin(t, search, s) : follow(t, search, s);
    if (ok && s->origin >= 0 && s->next > 0)
        ok = open_segments(t, s);
    if (!ok)
        lift_stream_reset(s);
    return ok;
}

typedef struct blend { /* of the segments that cover a moment */
    double total, heaviest;
    int32_t observed;
    const segment_posterior *main; /* the heaviest */
} blend;

/* Weight of a segment at one of its moments: most in its middle. */
static double weight_at(const lift_table *t, double at)
{
    double const edge = at < t->prior.frames - 1 - at ? at : t->prior.frames - 1 - at;
    return edge + 0.5 > 1e-3 ? edge + 0.5 : 1e-3;
}

/* Running mean and variance of a weighted mixture. */
static void mix(const lift_table *t, const double *mean, const double *sd, double share, gait_lift_frame *out)
{
    for (int32_t r = 0; r < t->reported; r++)
        for (int32_t a = 0; a < 3; a++) {
            double *const m = &out->marker[t->order[r]][a], *const v = &out->sd[t->order[r]][a];
            double const off = mean[3 * r + a] - *m, own = sd[3 * r + a];
            *v = (1.0 - share) * (*v + share * off * off) + share * own * own;
            *m += share * off;
        }
}

static void blend_segment(const lift_table *t, const lift_stream *s, const stream_segment *segment,
                          lift_query *q, blend *b, gait_lift_frame *out)
{
    const segment_posterior *const posterior = &segment->posterior[segment->best];
    double const weight = weight_at(t, q->at);
    lift_read(t, posterior, q, s->mean, s->sd);
    b->total += weight;
    b->observed += posterior->observed;
    if (weight > b->heaviest) {
        b->heaviest = weight;
        b->main = posterior;
    }
    mix(t, s->mean, s->sd, weight / b->total, out);
}

/* The frame `lag` frames ago, or the first one that is covered by a segment still kept. */
static uint64_t frame_of(const lift_table *t, const lift_stream *s)
{
    int64_t const kept = oldest_segment(s);
    uint64_t f = s->pushed - 1 - (uint64_t)t->cfg.lag;
    while (f + 1 < s->pushed && time_of(s, f) < (double)kept * s->step - 1e-9)
        f++;
    return f;
}

bool lift_stream_estimate(const lift_table *t, const lift_stream *s, gait_lift_frame *out)
{
    if (s->pushed <= (uint64_t)t->cfg.lag)
        return false;
    uint64_t const frame = s->next ? frame_of(t, s) : s->pushed - 1 - (uint64_t)t->cfg.lag;
    memset(out, 0, sizeof *out);
    out->utime = s->past.utime[ring_index(s, frame)];
    out->frame = frame;
    out->status = GAIT_TRACK_INIT;
    if (!s->next)
        return true;
    lift_observations const observed = weighted_frame(t, s, frame);
    lift_query q = {.count = t->reported, .observed = &observed};
    double const time = time_of(s, frame);
    blend b = {0};
    for (int64_t i = oldest_segment(s); i < s->next; i++)
        if (covers(s, i, time)) {
            q.at = moment_of(t, s, i, frame);
            blend_segment(t, s, segment_at(s, i), &q, &b, out);
        }
    if (!b.main) { /* between two segments that do not touch */
        int64_t const i = (int64_t)(time / s->step) < s->next ? (int64_t)(time / s->step) : s->next - 1;
        q.at = t->prior.frames - 1;
        blend_segment(t, s, segment_at(s, i), &q, &b, out);
    }
    out->heading = lift_heading(t, b.main);
    out->chi2_per_observation = b.main->observed ? lift_chi2(t, b.main) / b.main->observed : 0.0;
    double const wider = out->chi2_per_observation > 1.0 ? out->chi2_per_observation : 1.0;
    for (int32_t r = 0; r < q.count; r++)
        for (int32_t a = 0; a < 3; a++)
            out->sd[t->order[r]][a] = sqrt(wider * out->sd[t->order[r]][a]);
    bool const poor =
        s->poor_fit || (t->cfg.fit_threshold > 0.0 && out->chi2_per_observation > t->cfg.fit_threshold);
    out->status = poor ? GAIT_TRACK_AMBIGUOUS : GAIT_TRACK_TRACKING;
    out->flags = (b.observed ? 0u : GAIT_LIFT_UNOBSERVED) | (poor ? GAIT_LIFT_POOR_FIT : 0u);
    return true;
}
