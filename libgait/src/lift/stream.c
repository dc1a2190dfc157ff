#include "lift/stream.h"

#include "base/fmath.h"
#include "lift/continue.h"
#include "lift/robust.h"
#include "lift/read.h"
#include "lift/refit.h"

#include <string.h>

#define SLOWEST 10.0 /* frames per second down to which `lag` frames are kept */
#define DOUBTS  0.25 /* share of doubted numbers from which a segment is the one that is wrong */
#define FIRST   0.5  /* of the misfit allowed: nothing before a first segment speaks for it */

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
    s->past.room = i_max(round_up(s->span * t->cfg.max_rate) + 2, t->cfg.lag + 1);
    s->parts = round_up((double)p->frames / (double)p->hop) + round_up(t->cfg.lag / SLOWEST / s->step) + 1;
    size_t const room = (size_t)s->past.room;
    s->past.utime = TAKE(a, int64_t, room);
    s->past.uv = TAKE(a, double, room * J * 2);
    s->past.sd = TAKE(a, double, room *J);
    s->past.raw = TAKE(a, double, room *J);
    s->at = TAKE(a, double, room);
    s->uv = TAKE(a, double, room * J * 2);
    s->sd = TAKE(a, double, room *J);
    s->calm = TAKE(a, double, room *J);
    s->jump.frame = TAKE(a, int32_t, room);
    s->jump.apart = TAKE(a, double, room);
    s->guess = TAKE(a, double, J * 3);
    s->mean = TAKE(a, double, J * 3);
    s->spread = TAKE(a, double, J * 3);
    s->new_uv = TAKE(a, double, J * 2);
    s->new_sd = TAKE(a, double, J);
    s->part = TAKE(a, stream_segment, (size_t)s->parts);
    for (int32_t i = 0; i < s->parts; i++) {
        segment_posterior *const belief = TAKE(a, segment_posterior, K);
        if (s->part)
            s->part[i].belief = belief;
        for (size_t c = 0; c < K; c++) {
            segment_posterior placed;
            segment_posterior_layout(a, t, &placed);
            if (belief)
                belief[c] = placed;
        }
    }
}

void lift_stream_reset(lift_stream *s)
{
    s->pushed = 0;
    s->origin = s->last = -1;
    s->next = 0;
    s->misfit = false;
}

static void keep_frame(const lift_table *t, lift_stream *s, int64_t utime, const lift_seen *seen)
{
    size_t const i = (size_t)(s->pushed % (uint64_t)s->past.room), J = (size_t)t->prior.markers;
    s->past.utime[i] = s->last = utime;
    memcpy(s->past.uv + i * J * 2, seen->uv, J * 2 * sizeof(double));
    memcpy(s->past.sd + i * J, seen->sd, J * sizeof(double));
    memcpy(s->past.raw + i * J, seen->sd, J * sizeof(double));
    s->pushed++;
}

/* Add a frame to every component of a segment, linearised about the guess. */
static void add_frame(const lift_table *t, const lift_stream *s, stream_segment *part, uint64_t frame)
{
    lift_seen const seen = lift_stream_frame(t, s, frame), raw = lift_stream_raw(t, s, frame);
    for (int32_t c = 0; c < t->prior.components; c++)
        lift_add(t, &part->belief[c], lift_stream_moment(t, s, part->index, lift_stream_time(s, frame)),
                 &seen, s->guess, 0.0);
    for (int32_t j = 0; j < t->prior.markers; j++)
        part->doubted += lift_seen_at(&raw, j) && seen.sd[j] > raw.sd[j] ? 2 : 0;
}

/* Where a segment has the points of the newest frame, and which are far from there. */
static void judge_frame(const lift_table *t, lift_stream *s, const stream_segment *part)
{
    uint64_t const frame = s->pushed - 1;
    lift_seen const seen = lift_stream_raw(t, s, frame);
    (void)lift_robust_weights(t, &part->belief[part->best],
                     lift_stream_moment(t, s, part->index, lift_stream_time(s, frame)), &seen, false,
                     s->guess, s->past.sd + frame % (uint64_t)s->past.room * (size_t)t->prior.markers);
}

static bool solve_part(const lift_table *t, stream_segment *part)
{
    double best = -DBL_MAX;
    bool ok = true;
    for (int32_t c = 0; c < t->prior.components; c++) {
        segment_posterior *const b = &part->belief[c];
        ok &= lift_solve(t, b);
        if (t->prior.components == 1 || !ok)
            continue;
        double const evidence = lift_evidence(t, b) + m_log64((double)t->prior.weight[c]);
        if (evidence > best) {
            best = evidence;
            part->best = c;
        }
    }
    return ok;
}

/* Where a segment puts what is seen in a frame: s->guess. */
static void guess_frame(const lift_table *t, lift_stream *s, const stream_segment *part, uint64_t frame)
{
    lift_seen const seen = lift_stream_frame(t, s, frame);
    int32_t marker[GAIT_MAX_MARKERS], count = 0;
    for (int32_t j = 0; j < t->prior.markers; j++)
        if (lift_seen_at(&seen, j))
            marker[count++] = j;
    lift_places(t, &part->belief[part->best],
                lift_stream_moment(t, s, part->index, lift_stream_time(s, frame)), marker, count, s->mean);
    for (int32_t r = 0; r < count; r++)
        memcpy(s->guess + 3 * marker[r], s->mean + 3 * r, 3 * sizeof *s->mean);
}

/* Are so many points of a segment doubted that it is the segment which is wrong? */
static bool doubtful(const stream_segment *part)
{
    return part->doubted > DOUBTS * part->belief[part->best].observed;
}

/* Begin segment `index` where the one before it will be, and add the frames that fall into it. */
static bool open_part(const lift_table *t, lift_stream *s, int64_t index)
{
    const stream_segment *const before = lift_stream_segment(s, index - 1);
    stream_segment *const part = lift_stream_segment(s, index);
    *part = (stream_segment){.index = index, .best = before->best, .belief = part->belief};
    for (int32_t c = 0; c < t->prior.components; c++)
        lift_continue(t, &before->belief[before->best], c, &part->belief[c], s->guess);
    for (uint64_t f = lift_stream_oldest(s); f < s->pushed; f++) {
        if (!lift_stream_covers(s, index, lift_stream_time(s, f)))
            continue;
        guess_frame(t, s, before, f);
        add_frame(t, s, part, f);
    }
    return solve_part(t, part);
}

/* Begin all segments whose time has come. */
static bool open_parts(const lift_table *t, lift_stream *s)
{
    double const now = lift_stream_time(s, s->pushed - 1);
    bool ok = true;
    while (ok && (double)s->next * s->step <= now + 1e-9)
        ok = open_part(t, s, s->next++);
    return ok;
}

/* Does a segment contradict what is seen, and may it be searched for?  `share`: of the misfit allowed. */
static bool contradicts(const lift_table *t, const stream_segment *part, double share)
{
    const segment_posterior *const b = &part->belief[part->best];
    bool const wrong = lift_misfit(t, b) > share * t->cfg.misfit * b->observed || doubtful(part);
    return wrong && t->cfg.misfit > 0.0 && t->cfg.heading_sd < 0.0;
}

/* A segment is over. Nobody seen in it: start anew with the next who is. It does not fit: search for it,
 * and begin those after it again. */
static bool close_part(const lift_table *t, lift_search *search, lift_stream *s, stream_segment *part)
{
    part->closed = true;
    if (part->belief[part->best].observed == 0) {
        lift_stream_reset(s);
        return true;
    }
    s->misfit = contradicts(t, part, 1.0);
    if (!s->misfit)
        return true;
    bool ok = lift_refit(t, search, s, part->index);
    int64_t const opened = s->next;
    for (s->next = part->index + 1; ok && s->next < opened; s->next++)
        ok = open_part(t, s, s->next);
    return ok;
}

/* Add the newest frame to the segments it falls into, the oldest first: it says where all are to be linearised, and
 * which points are doubted. */
static bool follow(const lift_table *t, lift_search *search, lift_stream *s)
{
    uint64_t const frame = s->pushed - 1;
    double const now = lift_stream_time(s, frame);
    bool ok = true, first = true;
    for (int64_t i = s->next > s->parts ? s->next - s->parts : 0; ok && i < s->next; i++) {
        stream_segment *const part = lift_stream_segment(s, i);
        if (part->closed)
            continue;
        if (!lift_stream_covers(s, i, now)) {
            ok = close_part(t, search, s, part);
            if (s->origin < 0 || s->misfit)
                return ok; /* begun anew: the frame has been added, or there is nobody */
            continue;
        }
        if (first)
            judge_frame(t, s, part);
        add_frame(t, s, part, frame);
        ok = ok && solve_part(t, part);
        first = false;
    }
    return ok;
}

/* Fit the first segment, which is not relied on where it fits badly; where points contradict one another it begins
 * with the next frame instead. */
static bool begin(const lift_table *t, lift_search *search, lift_stream *s)
{
    if (lift_stream_time(s, s->pushed - 1) < s->span - 1e-9)
        return true;
    if (!lift_refit(t, search, s, 0))
        return false;
    stream_segment *const first = lift_stream_segment(s, 0);
    s->next = !doubtful(first);
    s->misfit = contradicts(t, first, FIRST);
    for (uint64_t f = lift_stream_oldest(s); !s->next && f < s->pushed; f++)
        if (lift_stream_time(s, f) > 0.0) {
            s->origin = s->past.utime[f % (uint64_t)s->past.room];
            break;
        }
    return true;
}

static bool anybody(const lift_table *t, const lift_seen *seen)
{
    bool any = false;
    for (int32_t j = 0; j < t->prior.markers; j++)
        any |= lift_seen_at(seen, j);
    return any;
}

bool lift_stream_push(const lift_table *t, lift_search *search, lift_stream *s, int64_t utime,
                      const lift_seen *seen)
{
    if (s->last >= 0 && (double)(utime - s->last) > 1e6 * t->cfg.max_gap)
        lift_stream_reset(s);
    if (s->origin < 0) {
        s->pushed = 0;
        s->last = utime;
        if (!anybody(t, seen))
            return true;
        s->origin = utime;
    }
    keep_frame(t, s, utime, seen);
    bool ok = s->next == 0 ? begin(t, search, s) : follow(t, search, s);
    if (ok && s->origin >= 0 && s->next > 0)
        ok = open_parts(t, s);
    if (!ok)
        lift_stream_reset(s);
    return ok;
}
