#include "tracker/fixed_lag.h"
#include "tracker/class_strata.h"
#include "tracker/estimate.h"
#include "tracker/hypotheses.h"
#include <string.h>

static const int64_t CHECKED_TIME = 700000; /* microseconds that a check averages over at least */

void fixed_lag_record(gait_tracker *t, const gait_estimate *e)
{
    int32_t const slot = t->core->generation;
    memcpy(history_parents(&t->history, slot), t->filter.parent,
           (size_t)t->cfg.particles * sizeof *t->filter.parent);
    t->history.record[slot] = (generation_record){.age = e->utime - t->core->start_utime,
                                                  .frame = e->frame,
                                                  .log_evidence = e->log_evidence,
                                                  .status = (int32_t)e->status,
                                                  .flags = e->flags};
}

int32_t fixed_lag_reach(const gait_tracker *t)
{
    uint64_t const steps = t->core->frame, depth = (uint64_t)t->history.depth;
    return (int32_t)(steps < depth ? steps : depth) - 1;
}

/* Sum the weights of the current particles on their ancestors `back` steps ago. */
static void sum_descendants(gait_tracker *t, int32_t back, double *weight)
{
    const particle_history *const h = &t->history;
    for (int32_t i = 0; i < t->capacity; i++)
        weight[i] = 0.0;
    for (int32_t i = 0; i < t->cfg.particles; i++) {
        int32_t a = i;
        for (int32_t k = 0; k < back; k++)
            a = history_parents(h, history_slot(h, t->core->generation, k))[a];
        weight[a] += t->filter.weight[i];
    }
}

/* Move the ancestors that have any weight to the front; returns how many there are. */
static int32_t gather(lag_scratch *s, int32_t n)
{
    int32_t count = 0;
    for (int32_t i = 0; i < n; i++)
        if (s->weight[i] > 0.0) {
            s->ancestor[count] = i;
            s->weight[count++] = s->weight[i];
        }
    return count;
}

/* Ranges of the gathered ancestors, from those of all. */
static strata gathered_strata(const strata *all, const int32_t *ancestor, int32_t n)
{
    strata s = *all;
    for (int32_t k = 0, i = 0; k <= all->count; k++) {
        while (i < n && ancestor[i] < all->first[k])
            i++;
        s.first[k] = i;
    }
    return s;
}

/* Whether another body fitted as well, or did so soon after: the checks are averages over the frames before. */
static bool others_fitted(const gait_tracker *t, int32_t back, int64_t age)
{
    for (int32_t k = back; k >= 0; k--) {
        const generation_record *const r =
            &t->history.record[history_slot(&t->history, t->core->generation, k)];
        if (r->age - age <= CHECKED_TIME && (r->flags & GAIT_EST_OTHERS_FIT))
            return true;
    }
    return false;
}

/* The present status is the frame's own, and a track that was lost stays lost; otherwise the status depends on what is
 * known now of the person and of left and right, and on the checks. */
static gait_track_status lagged_status(const gait_tracker *t, int32_t back, const generation_record *then,
                                       float hypothesis_weight)
{
    gait_track_status const status = (gait_track_status)then->status;
    if (back == 0 || status == GAIT_TRACK_LOST)
        return status;
    if (t->core->found && hypothesis_weight >= DOMINANT_WEIGHT && !hypotheses_open(t) &&
        !others_fitted(t, back, then->age))
        return GAIT_TRACK_TRACKING;
    return status == GAIT_TRACK_INIT ? status : GAIT_TRACK_AMBIGUOUS;
}

void fixed_lag_estimate(gait_tracker *t, int32_t back, gait_estimate *out)
{
    lag_scratch *const s = &t->lag;
    int32_t const slot = history_slot(&t->history, t->core->generation, back);
    generation_record const record = t->history.record[slot];
    gait_estimate e = {.utime = t->core->start_utime + record.age,
                       .frame = record.frame,
                       .log_evidence = record.log_evidence};
    weighted_particles p = {
        .all = history_particles(&t->history, slot), .index = s->ancestor, .weight = s->weight};
    sum_descendants(t, back, s->weight);
    p.n = gather(s, p.all.n);
    pf const weights = {.n = p.n, .weight = s->weight};
    int32_t best = pf_heaviest(&weights);
    strata of;
    if (t->classes) {
        of = gathered_strata(&t->history.strata[slot], s->ancestor, p.n);
        p.strata = &of;
        (void)class_strata_best(&of, s->weight, &best);
    }
    estimate_weighted(t, &p, best, &e);
    e.ess = (float)pf_ess(&weights);
    e.flags = record.flags;
    e.status = lagged_status(t, back, &record, e.hypothesis_weight);
    *out = e;
}
