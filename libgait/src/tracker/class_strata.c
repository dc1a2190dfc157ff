#include "tracker/class_strata.h"
#include "base/fmath.h"
#include "filter/class_change.h"
#include <string.h>

static const float RESAMPLE_TIME = 0.1f; /* seconds after which particles may change class in any case */
static const float LEAVING = 0.5f;       /* largest share of a particle's weight that changes class at once */
static const double MATTERS = 0.05; /* probability of a class from which its effective sample size counts */
static const int64_t STILL_TIME =
    500000;                         /* microseconds of standing still after which either leg may go first */
static const float SCORE_SD = 0.5f; /* of a person's scores in a class in which they have been seen before */
static const float DRIFT_TIME = 0.25f;  /* seconds over which the drift of a standing estimate is averaged */
static const float DRIFT_MEMORY = 1.0f; /* seconds for which it counts after the estimate has moved on */
static const float DRIFT_SD = 0.1f;     /* metres per second, of people who do stand */

/* ---- ranges ---- */
/* Append ranges of n particles from `first` on, in multiples of `unit`: each class gets the minimum, and the rest is shared
 * by probability. */
static void share_out(const gait_tracker *t, const double *probability, int32_t first, int32_t n,
                      int32_t unit, strata *s)
{
    int32_t const classes = t->model->classes, units = n / unit;
    int32_t const least = i_max(1, units / (CLASS_SHARE - 1 + classes)), rest = units - classes * least;
    int32_t top = 0, left = rest;
    double sum = 0.0;
    for (int32_t c = 0; c < classes; c++) {
        sum += probability[c];
        top = probability[c] > probability[top] ? c : top;
    }
    for (int32_t c = 0; c < classes; c++)
        left -= c == top ? 0 : (int32_t)((double)rest * (probability[c] / sum));
    for (int32_t c = 0; c < classes; c++) {
        int32_t const more = c == top ? left : (int32_t)((double)rest * (probability[c] / sum));
        s->first[s->count] = first;
        s->motion_class[s->count++] = c;
        first += (least + more) * unit;
    }
    s->first[s->count] = first;
}

static void set_weights(pf *f, int32_t first, int32_t count, double total)
{
    double const w = total / (double)count, lw = total > 0.0 ? m_log64(w) : -1e300;
    for (int32_t i = first; i < first + count; i++) {
        f->weight[i] = w;
        f->log_weight[i] = lw;
    }
}

void class_strata_begin(gait_tracker *t, const double *probability)
{
    strata *const s = tracker_strata(t);
    s->count = 0;
    share_out(t, probability, 0, t->filter.n, 2 * BLOCK, s);
    for (int32_t k = 0; k < s->count; k++)
        set_weights(&t->filter, s->first[k], s->first[k + 1] - s->first[k], probability[s->motion_class[k]]);
    *t->next = *s;
}

void class_strata_split(gait_tracker *t, const double share[2])
{
    strata *const s = tracker_strata(t);
    strata const one = *s;
    int32_t const half = t->filter.n / 2;
    double total[MAX_STRATA], sum = 0.0;
    for (int32_t k = 0; k < one.count; k++) {
        total[k] = t->filter.weight[one.first[k]] * (double)(one.first[k + 1] - one.first[k]);
        sum += total[k];
    }
    s->count = 0;
    for (int32_t h = 0; h < 2; h++)
        for (int32_t k = 0; k < one.count; k++) {
            int32_t const first = h * half + one.first[k] / 2, count = (one.first[k + 1] - one.first[k]) / 2;
            s->first[s->count] = first;
            s->motion_class[s->count++] = one.motion_class[k];
            set_weights(&t->filter, first, count, share[h] * total[k] / sum);
        }
    s->first[s->count] = t->filter.n;
}

/* ---- resampling ---- */
bool class_strata_due(const gait_tracker *t)
{
    const strata *const s = tracker_strata(t);
    double p[GAIT_MAX_CLASSES];
    if (t->core->ess == 0.0 || seconds_since(t, t->core->start_utime + t->classes->resampled) > RESAMPLE_TIME)
        return true;
    class_strata_probability(s, t->filter.weight, p);
    for (int32_t k = 0; k < s->count; k++) {
        double sum = 0.0, squares = 0.0;
        for (int32_t i = s->first[k]; i < s->first[k + 1]; i++) {
            sum += t->filter.weight[i];
            squares += t->filter.weight[i] * t->filter.weight[i];
        }
        if (p[s->motion_class[k]] > MATTERS &&
            sum * sum < (double)t->cfg.resample_ess * squares * (double)(s->first[k + 1] - s->first[k]))
            return true;
    }
    return false;
}

/* Probability that particle i is in each class after this time, to[class][i], if it is now in class m. */
static void change_probability(const gait_tracker *t, const gait_model *m, int32_t i, float seconds,
                               float *to, size_t n)
{
    float const most = LEAVING / (float)(m->classes - 1);
    float stay = 1.0f;
    for (int32_t c = 0; c < m->classes; c++)
        if (c != m->motion_class) {
            float const rate =
                class_change_rate(m, c, field(&t->particles, F_PHASE)[i], field(&t->particles, F_RATE)[i]);
            to[(size_t)c * n + (size_t)i] = f_min(rate * seconds, most);
            stay -= to[(size_t)c * n + (size_t)i];
        }
    to[(size_t)m->motion_class * n + (size_t)i] = stay;
}

/* What resampling needs, in t->rows. */
typedef struct resampling_scratch {
    double *weight; /* of every particle in one class */
    float *to;      /* to[class][particle]: probability of being in each class afterwards */
} resampling_scratch;

static resampling_scratch scratch_in(float *rows, size_t particles)
{
    return (resampling_scratch){.weight = (double *)(void *)rows, .to = rows + 2 * particles};
}

void class_strata_resample(gait_tracker *t, int32_t begin, int32_t end, int32_t n, uint32_t u)
{
    const strata *const then = tracker_strata(t);
    pf *const f = &t->filter;
    size_t const all = (size_t)f->n;
    resampling_scratch const scratch = scratch_in(t->rows, all);
    double *const weight = scratch.weight, total[GAIT_MAX_CLASSES];
    float *const to = scratch.to;
    float const seconds = seconds_since(t, t->core->start_utime + t->classes->resampled);
    double now[GAIT_MAX_CLASSES] = {0.0};
    for (int32_t k = 0; k < then->count; k++) {
        int32_t const c = then->motion_class[k];
        for (int32_t i = i_max(begin, then->first[k]); i < i_min(end, then->first[k + 1]); i++) {
            now[c] += f->weight[i];
            change_probability(t, t->layouts[c].model, i, seconds, to, all);
        }
    }
    int32_t const own = t->next->count;
    share_out(t, now, begin, n, t->core->hypotheses.stage == HYPOTHESES_TWO ? BLOCK : 2 * BLOCK, t->next);
    for (int32_t k = own; k < t->next->count; k++) {
        int32_t const c = t->next->motion_class[k], first = t->next->first[k];
        double sum = 0.0;
        for (int32_t i = begin; i < end; i++) {
            weight[i] = f->weight[i] * (double)to[(size_t)c * all + (size_t)i];
            sum += weight[i];
        }
        total[c] = sum;
        pf_draw(sum > 0.0 ? weight + begin : f->weight + begin, end - begin, f->cumulative + begin,
                t->next->first[k + 1] - first, u, f->parent + first);
        for (int32_t i = first; i < t->next->first[k + 1]; i++)
            f->parent[i] += begin;
    }
    for (int32_t k = own; k < t->next->count; k++)
        set_weights(f, t->next->first[k], t->next->first[k + 1] - t->next->first[k],
                    total[t->next->motion_class[k]]);
}

void class_strata_origins(gait_tracker *t, const strata *then)
{
    for (int32_t i = 0; i < t->filter.n; i++)
        t->origin[i] = (uint8_t)then->motion_class[stratum_at(then, t->filter.parent[i])];
}

void class_strata_enter(const gait_tracker *t, uint32_t counter, float dt, int32_t first, int32_t lanes,
                        particle_block *p)
{
    const class_state *const s = t->classes;
    int32_t const to = class_at(t, first);
    const state_layout *const layout = &t->layouts[to];
    int64_t const still = t->core->utime - t->core->start_utime - s->moved;
    class_entry const e = {.layout = layout,
                           .seed = t->cfg.seed,
                           .frame = counter,
                           .score = s->score[to],
                           .score_sd = s->known >> to & 1u ? SCORE_SD : 1.0f,
                           .resumes = to == s->moved_class && class_stands(t, s->reported) &&
                                      t->core->hypotheses.stage == HYPOTHESES_ONE && still < STILL_TIME,
                           .phase = t->core->reported_phase,
                           .seconds = in_walking_time(t, 1e-6f * (float)still - dt)};
    for (int32_t lane = 0; lane < lanes; lane++) {
        particle_state one;
        if (t->origin[first + lane] == to)
            continue;
        for (int32_t f = 0; f < t->particles.fields; f++)
            one.f[f] = p->f[f][lane];
        class_change_enter(&e, t->origin[first + lane], first + lane, &one);
        for (int32_t f = 0; f < t->particles.fields; f++)
            p->f[f][lane] = one.f[f];
    }
}

/* ---- drift ---- */
/* Each standing particle stays where it is, but the images decide which of them last, so that together they follow a person
 * who walks slowly. */
void class_strata_penalise_drift(gait_tracker *t)
{
    const strata *const s = tracker_strata(t);
    const float *const v = t->classes->drift;
    float const nats = (v[0] * v[0] + v[1] * v[1]) / (2.0f * DRIFT_SD * DRIFT_SD);
    for (int32_t k = 0; k < s->count; k++)
        for (int32_t i = s->first[k]; class_stands(t, s->motion_class[k]) && i < s->first[k + 1]; i++)
            t->loglik[i] -= nats;
}

void class_strata_support(gait_tracker *t, int32_t motion_class, const particle_state *mean)
{
    class_state *const s = t->classes;
    float const dt = seconds_since(t, t->core->support_utime);
    bool const stood = class_stands(t, s->supported) && class_stands(t, motion_class);
    float const keep = m_exp(-dt / (stood ? DRIFT_TIME : DRIFT_MEMORY));
    for (int32_t k = 0; k < 2; k++) {
        float const way = mean->f[F_X + k] - t->core->last_supported.f[F_X + k];
        s->drift[k] = keep * s->drift[k] + (stood && dt > 0.0f ? (1.0f - keep) * (way / dt) : 0.0f);
    }
    s->supported = motion_class;
}

/* ---- what is reported ---- */
void class_strata_probability(const strata *s, const double *weight, double out[GAIT_MAX_CLASSES])
{
    double sum = 0.0;
    for (int32_t c = 0; c < GAIT_MAX_CLASSES; c++)
        out[c] = 0.0;
    for (int32_t k = 0; k < s->count; k++)
        for (int32_t i = s->first[k]; i < s->first[k + 1]; i++)
            out[s->motion_class[k]] += weight[i];
    for (int32_t c = 0; c < GAIT_MAX_CLASSES; c++)
        sum += out[c];
    for (int32_t c = 0; c < GAIT_MAX_CLASSES; c++)
        out[c] /= sum;
}

int32_t class_strata_best(const strata *s, const double *weight, int32_t *best)
{
    double p[GAIT_MAX_CLASSES], most = -1.0;
    int32_t top = 0, at = stratum_at(s, *best);
    class_strata_probability(s, weight, p);
    for (int32_t c = 1; c < GAIT_MAX_CLASSES; c++)
        top = p[c] > p[top] ? c : top;
    while (at > 0 && s->motion_class[at] > s->motion_class[at - 1]) /* first stratum of this hypothesis */
        at--;
    while (s->motion_class[at] != top)
        at++;
    for (int32_t i = s->first[at]; i < s->first[at + 1]; i++)
        if (weight[i] > most) {
            most = weight[i];
            *best = i;
        }
    return top;
}

void class_strata_report(gait_tracker *t, const particle_state *mean, gait_estimate *e)
{
    class_state *const s = t->classes;
    int64_t const age = t->core->utime - t->core->start_utime;
    int32_t const now = e->motion_class;
    bool const still = class_stands(t, now);
    bool const was_still = class_stands(t, s->reported);
    if (still)
        e->mean.phase = t->core->reported_phase;
    if (was_still && age - s->moved >= STILL_TIME && t->core->hypotheses.stage != HYPOTHESES_ACQUISITION) {
        if (still)
            t->core->hypotheses.stage = HYPOTHESES_ONE;
        else
            s->open_sides = 1;
    }
    for (int32_t c = 0; c < t->model->classes; c++)
        if (t->layouts[c].model->curves == t->layouts[now].model->curves) {
            memcpy(s->score[c], mean->f + F_COEF, sizeof s->score[c]);
            s->known |= 1u << c;
        }
    if (!still) {
        s->moved = age;
        s->moved_class = now;
    }
    s->reported = now;
}
