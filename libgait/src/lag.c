#include "lag.h"
#include "estimate.h"
#include "modes.h"
#include <string.h>

void lag_layout_state(lag *l, arena *a, int32_t frames, int32_t n, int32_t fields)
{
    l->depth = frames > 0 ? frames + 1 : 0;
    if (l->depth == 0)
        return;
    l->note = TAKE(a, lag_note, l->depth);
    l->value = TAKE(a, float, (size_t)l->depth *(size_t)fields *(size_t)n);
    l->parent = TAKE(a, int32_t, (size_t)l->depth *(size_t)n);
}

void lag_layout_work(lag *l, arena *a, int32_t n, int32_t fields)
{
    if (l->depth == 0)
        return;
    l->people = population_layout(a, n, fields);
    l->weight = TAKE(a, double, n);
}

/* Where step number `step` since start is kept. */
static size_t slot_of(const lag *l, uint64_t step)
{
    return (size_t)(step % (uint64_t)l->depth);
}

static population kept_people(const gait_tracker *t, size_t slot)
{
    population p = t->gen[0].people;
    p.n = t->room; /* of which as many are in use as were then */
    p.value = t->past.value + slot * (size_t)p.fields * (size_t)p.n;
    return p;
}

void lag_keep(gait_tracker *t, const gait_estimate *e)
{
    lag *const l = &t->past;
    if (l->depth == 0)
        return;
    size_t const slot = slot_of(l, e->frame), n = (size_t)t->cfg.particles;
    population const now = t->gen[t->core->current].people, kept = kept_people(t, slot);
    for (int32_t f = 0; f < now.fields; f++)
        memcpy(field(&kept, f), field(&now, f), n * sizeof *now.value);
    memcpy(l->parent + slot * (size_t)t->room, t->filter.parent, n * sizeof *l->parent);
    l->note[slot] = (lag_note){.age = e->utime - t->core->start_utime,
                               .frame = e->frame,
                               .log_evidence = e->log_evidence,
                               .status = e->status,
                               .flags = e->flags};
}

int32_t lag_reach(const gait_tracker *t)
{
    uint64_t const steps = t->core->frame, depth = (uint64_t)t->past.depth;
    return (int32_t)(steps < depth ? steps : depth) - 1;
}

/* Sum the weights of today's particles on their ancestors `back` steps ago: weight[room]. */
static void weigh_ancestors(gait_tracker *t, int32_t back, double *weight)
{
    uint64_t const last = t->core->frame - 1;
    for (int32_t i = 0; i < t->room; i++)
        weight[i] = 0.0;
    for (int32_t i = 0; i < t->cfg.particles; i++) {
        int32_t a = i;
        for (uint64_t k = 0; k < (uint64_t)back; k++)
            a = t->past.parent[slot_of(&t->past, last - k) * (size_t)t->room + (size_t)a];
        weight[a] += t->filter.weight[i];
    }
}

/* Bring the ancestors that weigh anything to the front; returns how many there are. */
static int32_t gather(lag *l, const population *from)
{
    int32_t count = 0;
    l->people.n = from->n;
    for (int32_t i = 0; i < from->n; i++)
        if (l->weight[i] > 0.0) {
            for (int32_t f = 0; f < from->fields; f++)
                l->people.value[(size_t)f * (size_t)from->n + (size_t)count] = field(from, f)[i];
            l->weight[count++] = l->weight[i];
        }
    for (int32_t f = 1; f < from->fields; f++) /* close the gaps between the fields */
        memmove(l->people.value + (size_t)f * (size_t)count, l->people.value + (size_t)f * (size_t)from->n,
                (size_t)count * sizeof(float));
    l->people.n = count;
    return count;
}

/* Joints of the gathered ancestors, with the first task's scratch. */
static void place_joints(gait_tracker *t)
{
    lag *const l = &t->past;
    weigh_scratch *const w = &t->work[0];
    size_t const n = (size_t)l->people.n;
    for (int32_t begin = 0; begin < l->people.n; begin += BLOCK) {
        size_t const lanes = (size_t)i_min(BLOCK, l->people.n - begin);
        population_bodies(&t->rule, &l->people, begin, &w->body);
        kin_points(t->model, &w->body, w->points);
        for (size_t p = 0; p < (size_t)t->model->points; p++)
            for (size_t k = 0; k < 3; k++)
                memcpy(t->joint + (3 * p + k) * n + (size_t)begin, w->points[p][k], lanes * sizeof(float));
    }
}

/* What was lost stays lost; whether the modes are told apart is known better now. */
static int32_t status_now(const gait_tracker *t, int32_t then, float mode_mass)
{
    if (then == GAIT_STATUS_LOST)
        return then;
    if (mode_mass >= 0.7f && !modes_open(t))
        return GAIT_STATUS_TRACKING;
    return then == GAIT_STATUS_INIT ? then : GAIT_STATUS_AMBIGUOUS;
}

void lag_estimate(gait_tracker *t, int32_t back, gait_estimate *out)
{
    lag *const l = &t->past;
    size_t const slot = slot_of(l, t->core->frame - 1 - (uint64_t)back);
    population const then = kept_people(t, slot);
    lag_note const note = l->note[slot];
    gait_estimate e = {
        .utime = t->core->start_utime + note.age, .frame = note.frame, .log_evidence = note.log_evidence};
    weigh_ancestors(t, back, l->weight);
    gait_tracker past = *t; /* the same tracker holding the ancestors */
    past.filter.n = past.cfg.particles = gather(l, &then);
    past.filter.weight = l->weight;
    past.gen[t->core->current].people = l->people;
    place_joints(t);
    estimate_fill(&past, pf_heaviest(&past.filter), &e);
    e.ess = (float)pf_ess(&past.filter);
    e.flags = note.flags;
    e.status = status_now(t, note.status, e.mode_mass);
    *out = e;
}
