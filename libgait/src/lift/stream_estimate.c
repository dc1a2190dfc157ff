#include "lift/stream_estimate.h"

#include "lift/continue.h"

#include <string.h>

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

/* Mix in what a segment says: running mean and spread of a weighted mixture. */
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

static void add_part(const lift_table *t, const lift_stream *s, const stream_segment *part, lift_query *q,
                     blend *b, gait_lift_frame *out)
{
    const segment_posterior *const belief = &part->belief[part->best];
    double const weight = weight_at(t, q->at);
    lift_read(t, belief, q, s->mean, s->spread);
    b->total += weight;
    b->observed += belief->observed;
    if (weight > b->heaviest) {
        b->heaviest = weight;
        b->main = belief;
    }
    mix(t, s->mean, s->spread, weight / b->total, out);
}

/* The frame asked for, or the first that a segment still kept covers. */
static uint64_t frame_of(const lift_table *t, const lift_stream *s)
{
    int64_t const kept = s->next > s->parts ? s->next - s->parts : 0;
    uint64_t f = s->pushed - 1 - (uint64_t)t->cfg.lag;
    while (f + 1 < s->pushed && lift_stream_time(s, f) < (double)kept * s->step - 1e-9)
        f++;
    return f;
}

bool lift_estimate(const lift_table *t, const lift_stream *s, gait_lift_frame *out)
{
    if (s->pushed <= (uint64_t)t->cfg.lag)
        return false;
    uint64_t const frame = s->next ? frame_of(t, s) : s->pushed - 1 - (uint64_t)t->cfg.lag;
    memset(out, 0, sizeof *out);
    out->utime = s->past.utime[frame % (uint64_t)s->past.room];
    out->frame = frame;
    out->status = GAIT_TRACK_INIT;
    if (!s->next)
        return true;
    lift_seen const seen = lift_stream_frame(t, s, frame);
    lift_query q = {.count = t->reported, .seen = &seen};
    double const time = lift_stream_time(s, frame);
    blend b = {0};
    for (int64_t i = s->next > s->parts ? s->next - s->parts : 0; i < s->next; i++)
        if (lift_stream_covers(s, i, time)) {
            q.at = lift_stream_moment(t, s, i, time);
            add_part(t, s, lift_stream_segment(s, i), &q, &b, out);
        }
    if (!b.main) { /* between two segments that do not touch */
        int64_t const i = (int64_t)(time / s->step) < s->next ? (int64_t)(time / s->step) : s->next - 1;
        q.at = t->prior.frames - 1;
        add_part(t, s, lift_stream_segment(s, i), &q, &b, out);
    }
    out->heading = lift_heading(t, b.main);
    out->misfit = b.main->observed ? lift_misfit(t, b.main) / b.main->observed : 0.0;
    double const wider = out->misfit > 1.0 ? out->misfit : 1.0;
    for (int32_t r = 0; r < q.count; r++)
        for (int32_t a = 0; a < 3; a++)
            out->sd[t->order[r]][a] = sqrt(wider * out->sd[t->order[r]][a]);
    bool const misfit = s->misfit || (t->cfg.misfit > 0.0 && out->misfit > t->cfg.misfit);
    out->status = misfit ? GAIT_TRACK_AMBIGUOUS : GAIT_TRACK_TRACKING;
    out->flags = (b.observed ? 0u : GAIT_LIFT_UNSEEN) | (misfit ? GAIT_LIFT_MISFIT : 0u);
    return true;
}
