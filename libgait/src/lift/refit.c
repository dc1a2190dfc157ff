#include "lift/refit.h"

#include "lift/continue.h"
#include "lift/robust.h"

#include <string.h>

#define ASTRAY                                                                                               \
    4.0 /* squared deviations per number observed, 1 of noise alone: a search may have gone to wild points */
#define ROUGH 8.0  /* times the points' deviations: nobody is so far from everybody's mean motion */
enum { FITS = 4 }; /* after a search at most, while they doubt points */

/* The frames that fall into segment `index`; points that jump are not in `calm`. */
static lift_window window_of(const lift_table *t, lift_stream *s, int64_t index)
{
    size_t const J = (size_t)t->prior.markers;
    lift_window w = {.at = s->at, .uv = s->uv, .sd = s->sd};
    for (uint64_t f = lift_stream_oldest(s); f < s->pushed; f++) {
        lift_seen const seen = lift_stream_raw(t, s, f);
        if (!lift_stream_covers(s, index, lift_stream_time(s, f)))
            continue;
        s->at[w.frames] = lift_stream_moment(t, s, index, lift_stream_time(s, f));
        memcpy(s->uv + (size_t)w.frames * J * 2, seen.uv, J * 2 * sizeof(double));
        memcpy(s->calm + (size_t)w.frames * J, seen.sd, J * sizeof(double));
        w.frames++;
    }
    lift_spikes_clear(t, &w, s->calm, &s->jump);
    return w;
}

/* Doubt points of a segment by a fit to them, whatever was doubted before; how many. */
static int32_t doubt_window(const lift_table *t, lift_stream *s, const lift_window *w, const segment_posterior *b)
{
    size_t const J = (size_t)t->prior.markers;
    int32_t doubted = 0;
    for (int32_t f = 0; f < w->frames; f++) {
        lift_seen const seen = {.uv = w->uv + (size_t)f * J * 2, .sd = s->calm + (size_t)f * J};
        doubted += lift_robust_weights(t, b, w->at[f], &seen, true, s->guess, s->sd + (size_t)f * J);
    }
    return doubted;
}

/* Points that do not jump have their own deviations, so many times. */
static void believe(const lift_table *t, lift_stream *s, const lift_window *w, double times)
{
    for (size_t i = 0; i < (size_t)w->frames * (size_t)t->prior.markers; i++)
        s->sd[i] = times * s->calm[i];
}

/* Search by all points, of deviations so many times theirs, and go on from there without those that are far off. */
static bool fit_from(const lift_table *t, lift_search *search, lift_stream *s, const lift_window *w,
                     segment_posterior *b, double times, int32_t *doubted)
{
    lift_outcome outcome;
    int32_t before = times > 1.0 ? -1 : 0; /* a rough fit is never the last */
    believe(t, s, w, times);
    memcpy(b->place, t->cfg.place, sizeof b->place);
    bool ok = lift_fit(t, search, w, b, &outcome);
    *doubted = ok ? doubt_window(t, s, w, b) : 0;
    for (int32_t fits = 0; ok && *doubted != before && fits < FITS; fits++) {
        before = *doubted;
        ok = lift_fit_again(t, search, w, b);
        *doubted = ok ? doubt_window(t, s, w, b) : 0;
    }
    return ok;
}

/* Fit a segment to its points.  Where wild ones may have led the search astray it is made again, first while all say
 * less; the more probable fit counts. */
static bool fit(const lift_table *t, lift_search *search, lift_stream *s, const lift_window *w,
                segment_posterior *b, int32_t *doubted)
{
    bool ok = fit_from(t, search, s, w, b, 1.0, doubted);
    if (!ok || (*doubted == 0 && lift_misfit(t, b) <= ASTRAY * b->observed))
        return ok;
    double const usual = lift_evidence(t, b);
    ok = fit_from(t, search, s, w, b, ROUGH, doubted);
    if (ok && lift_evidence(t, b) < usual) /* there is no room to keep both */
        ok = fit_from(t, search, s, w, b, 1.0, doubted);
    return ok;
}

/* The frames of a window keep what was thought of their points. */
static void keep_doubts(const lift_table *t, const lift_stream *s, int64_t index)
{
    size_t const J = (size_t)t->prior.markers;
    const double *sd = s->sd;
    for (uint64_t f = lift_stream_oldest(s); f < s->pushed; f++)
        if (lift_stream_covers(s, index, lift_stream_time(s, f))) {
            memcpy(s->past.sd + f % (uint64_t)s->past.room * J, sd, J * sizeof *sd);
            sd += J;
        }
}

bool lift_refit(const lift_table *t, lift_search *search, lift_stream *s, int64_t index)
{
    stream_segment *const part = lift_stream_segment(s, index);
    segment_posterior *const b = &part->belief[0];
    lift_window const w = window_of(t, s, index);
    int32_t doubted;
    if (!fit(t, search, s, &w, b, &doubted))
        return false;
    keep_doubts(t, s, index);
    int32_t const c = b->component;
    if (c != 0) { /* every component has a belief of its own */
        segment_posterior const found = *b;
        part->belief[0] = part->belief[c];
        part->belief[c] = found;
    }
    part->index = index;
    part->best = c;
    part->doubted = 2 * doubted;
    part->closed = true; /* the other components are not followed in this segment */
    return true;
}
