#include "tracker/fixed_lag.h"
#include "tracker/estimate.h"
#include "tracker/hypotheses.h"
#include <string.h>

void fixed_lag_layout_state(fixed_lag *l, arena *a, int32_t frames, int32_t n, int32_t fields)
{
    l->depth = i_max(frames, 1) + 1;
    l->room = n;
    l->fields = fields;
    l->note = TAKE(a, fixed_lag_note, l->depth);
    l->count = TAKE(a, int32_t, l->depth);
    l->value = TAKE(a, float, (size_t)l->depth *(size_t)fields *(size_t)n);
    l->parent = TAKE(a, int32_t, (size_t)l->depth *(size_t)n);
}

void fixed_lag_layout_work(fixed_lag *l, arena *a)
{
    l->who = TAKE(a, int32_t, l->room);
    l->weight = TAKE(a, double, l->room);
}

particle_set fixed_lag_particles(const fixed_lag *l, int32_t slot)
{
    return (particle_set){.n = l->count[slot],
                        .fields = l->fields,
                        .value = l->value + (size_t)slot * (size_t)l->fields * (size_t)l->room};
}

static int32_t *parents(const fixed_lag *l, int32_t slot)
{
    return l->parent + (size_t)slot * (size_t)l->room;
}

void fixed_lag_keep(gait_tracker *t, const gait_estimate *e)
{
    fixed_lag *const l = &t->past;
    int32_t const slot = t->core->current;
    memcpy(parents(l, slot), t->filter.parent, (size_t)t->cfg.particles * sizeof *l->parent);
    l->note[slot] = (fixed_lag_note){.age = e->utime - t->core->start_utime,
                               .frame = e->frame,
                               .log_evidence = e->log_evidence,
                               .status = e->status,
                               .flags = e->flags};
}

int32_t fixed_lag_reach(const gait_tracker *t)
{
    uint64_t const steps = t->core->frame, depth = (uint64_t)t->past.depth;
    return (int32_t)(steps < depth ? steps : depth) - 1;
}

/* Sum the weights of today's particles on their ancestors `back` steps ago: weight[room]. */
static void weigh_ancestors(gait_tracker *t, int32_t back, double *weight)
{
    for (int32_t i = 0; i < t->room; i++)
        weight[i] = 0.0;
    for (int32_t i = 0; i < t->cfg.particles; i++) {
        int32_t a = i;
        for (int32_t k = 0; k < back; k++)
            a = parents(&t->past, fixed_lag_slot(&t->past, t->core->current, k))[a];
        weight[a] += t->filter.weight[i];
    }
}

/* Bring the weights of those that weigh anything to the front; returns how many there are. */
static int32_t gather(fixed_lag *l, int32_t n)
{
    int32_t count = 0;
    for (int32_t i = 0; i < n; i++)
        if (l->weight[i] > 0.0) {
            l->who[count] = i;
            l->weight[count++] = l->weight[i];
        }
    return count;
}

/* Joints of the gathered ancestors, with the first task's scratch. */
static void place_joints(gait_tracker *t, const crowd *c)
{
    likelihood_scratch *const w = &t->work[0];
    size_t const n = (size_t)c->n;
    for (int32_t begin = 0; begin < c->n; begin += BLOCK) {
        int32_t const lanes = i_min(BLOCK, c->n - begin);
        particle_block them;
        particle_block_get(&c->particles, c->who + begin, lanes, &them);
        particle_block_bodies(&t->rule, &them, &w->body);
        kin_points(t->model, &w->body, w->points);
        for (size_t p = 0; p < (size_t)t->model->points; p++)
            for (size_t k = 0; k < 3; k++)
                block_copy(t->joint + (3 * p + k) * n + (size_t)begin, w->points[p][k], lanes);
    }
}

/* What was lost stays lost; whether the modes are told apart is known better now. */
static int32_t status_now(const gait_tracker *t, int32_t then, float hypothesis_weight)
{
    if (then == GAIT_TRACK_LOST)
        return then;
    if (hypothesis_weight >= 0.7f && !hypotheses_open(t))
        return GAIT_TRACK_TRACKING;
    return then == GAIT_TRACK_INIT ? then : GAIT_TRACK_AMBIGUOUS;
}

void fixed_lag_estimate(gait_tracker *t, int32_t back, gait_estimate *out)
{
    fixed_lag *const l = &t->past;
    int32_t const slot = fixed_lag_slot(l, t->core->current, back);
    fixed_lag_note const note = l->note[slot];
    gait_estimate e = {
        .utime = t->core->start_utime + note.age, .frame = note.frame, .log_evidence = note.log_evidence};
    crowd c = {.particles = fixed_lag_particles(l, slot), .who = l->who, .weight = l->weight};
    weigh_ancestors(t, back, l->weight);
    c.n = gather(l, c.particles.n);
    pf const weights = {.n = c.n, .weight = l->weight};
    place_joints(t, &c);
    estimate_crowd(t, &c, pf_heaviest(&weights), &e);
    e.ess = (float)pf_ess(&weights);
    e.flags = note.flags;
    e.status = status_now(t, note.status, e.hypothesis_weight);
    *out = e;
}
