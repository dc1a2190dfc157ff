#include "tracker/snapshot.h"
#include "base/fmath.h"
#include "base/hash.h"
#include "tracker/hypotheses.h"
#include <string.h>

typedef struct snapshot_header {
    char magic[7];
    uint8_t format;
    uint32_t abi, version;
    uint64_t bytes;         /* of the whole snapshot */
    uint64_t model, config; /* digests: a snapshot fits only a tracker of the same model and configuration */
    uint64_t body;          /* hash of the state that follows */
} snapshot_header;

static const char MAGIC[7] = {'G', 'A', 'I', 'T', 'S', 'N', 'P'};
/* Raised by every change of the state that is saved.  10 (then the magic's last character) may lack fit_margin. */
enum { FORMAT = 14 };

static size_t state_bytes(const gait_tracker *t)
{
    return (size_t)(t->state_end - (unsigned char *)t->core);
}

/* Digest of the configuration without what does not change results (threads, tasks, instruction sets), and with the
 * cameras as the caller configured them, wherever they are in this frame. */
static uint64_t config_digest(const gait_tracker *t)
{
    gait_tracker_config c = t->cfg;
    c.particles = t->config_particles;
    memcpy(c.camera, t->home, (size_t)c.cameras * sizeof *c.camera);
    memset(&c.camera[c.cameras], 0, (size_t)(GAIT_MAX_CAMERAS - c.cameras) * sizeof *c.camera);
    memset(&c.exec, 0, sizeof c.exec);
    c.tasks = 0;
    c.cpu_mask = 0;
    return hash_fnv1a(HASH_INIT, &c, sizeof c);
}

size_t snapshot_bytes(const gait_tracker *t)
{
    return sizeof(snapshot_header) + state_bytes(t);
}

void snapshot_save(const gait_tracker *t, void *mem)
{
    snapshot_header h = {.format = FORMAT,
                         .abi = GAIT_ABI,
                         .version = GAIT_VERSION,
                         .bytes = snapshot_bytes(t),
                         .model = t->model->digest,
                         .config = config_digest(t),
                         .body = hash_state(t->core, state_bytes(t))};
    memcpy(h.magic, MAGIC, sizeof MAGIC);
    memcpy(mem, &h, sizeof h);
    memcpy((unsigned char *)mem + sizeof h, t->core, state_bytes(t));
}

/* An array of the state in the body of a snapshot, which need not be aligned. */
static const unsigned char *in_body(const gait_tracker *t, const unsigned char *body, const void *array)
{
    return body + ((const unsigned char *)array - (const unsigned char *)t->core);
}

/* More than any number of a state: what a step computes from numbers below it is finite. */
static const float LARGEST_NUMBER = 1e6f;

/* Whether all n numbers are that small; false for NaN. */
static bool moderate(const float *x, size_t n)
{
    bool ok = true;
    for (size_t i = 0; i < n; i++)
        ok &= fabsf(x[i]) <= LARGEST_NUMBER;
    return ok;
}

/* Microseconds since the start that no tracker reaches: differences of times below it cannot overflow. */
static const uint64_t LONGEST_AGE = 1ull << 62;

static bool flag(int32_t x)
{
    return x == 0 || x == 1;
}

static bool core_plausible(const gait_tracker *t, const tracker_core *c)
{
    bool ok = c->generation >= 0 && c->generation < t->history.depth && flag(c->started);
    ok &= c->ess >= 0.0 && c->ess <= 2.0 * (double)t->capacity && c->below_capacity >= 0 &&
          c->below_capacity < t->capacity;
    ok &= c->below_config >= 0 && c->below_config <= t->config_particles - 16;
    const hypotheses_state *const h = &c->hypotheses;
    ok &= h->stage >= HYPOTHESES_ONE && h->stage <= HYPOTHESES_TWO && h->since <= c->utime &&
          h->since >= c->start_utime;
    ok &= flag(h->left_right_known) && flag(h->phase_known) && flag(h->agreed);
    ok &= fabs(h->log_odds) < 1e6 && fabs(h->recent_log_ratio) < 1e12; /* false for NaN */
    ok &= c->start_utime <= c->utime && (uint64_t)c->utime - (uint64_t)c->start_utime < LONGEST_AGE;
    ok &= c->frame < LONGEST_AGE && c->support_utime <= c->utime && c->support_utime >= c->start_utime;
    ok &= c->rejuvenation_utime <= c->utime && c->rejuvenation_utime >= c->start_utime;
    ok &= c->usual_unexplained >= 0.0f && c->usual_unexplained < 1e9f && c->stature_sd_ratio >= 0.0f &&
          c->stature_sd_ratio < 1e9f;
    ok &= f_finite(&c->front_back_margin, 1) && f_finite(&c->fit_margin, 1);
    ok &= fabsf(c->left_right_margin) <= REPORT_LOG_ODDS;
    for (int32_t k = 0; k < t->cfg.cameras; k++) {
        const float map[3] = {c->map[k].scale, c->map[k].u0, c->map[k].v0};
        ok &= moderate(map, 3) && map[0] >= 0.0f && map[0] <= 2.0f;
    }
    return ok;
}

static bool weights_plausible(const gait_tracker *t, const unsigned char *body, const tracker_core *c)
{
    double sum = 0.0;
    for (int32_t i = 0; i < t->capacity - c->below_capacity; i++) {
        double weight, log_weight;
        int32_t parent;
        memcpy(&weight, in_body(t, body, &t->filter.weight[i]), sizeof weight);
        memcpy(&log_weight, in_body(t, body, &t->filter.log_weight[i]), sizeof log_weight);
        memcpy(&parent, in_body(t, body, &t->filter.parent[i]), sizeof parent);
        if (!(weight >= 0.0 && log_weight <= 1.0 && log_weight >= -2e300) || parent < 0 ||
            parent >= t->capacity)
            return false;
        sum += weight;
    }
    return sum > 0.999 && sum < 1.001;
}

/* What the steps since the start have recorded; older slots are not read. */
static bool records_plausible(const gait_tracker *t, const unsigned char *body, const tracker_core *c)
{
    const particle_history *const h = &t->history;
    for (int32_t k = 0; k < h->depth && (uint64_t)k < c->frame; k++) {
        generation_record r;
        memcpy(&r, in_body(t, body, &h->record[history_slot(h, c->generation, k)]), sizeof r);
        if (r.age < 0 || r.age > c->utime - c->start_utime || r.frame > c->frame ||
            !(fabs(r.log_evidence) < 1e300) || r.status < GAIT_TRACK_INIT || r.status > GAIT_TRACK_LOST)
            return false;
    }
    return true;
}

/* Slots of the history that no step has filled yet are zero. */
static bool history_plausible(const gait_tracker *t, const unsigned char *body)
{
    const particle_history *const h = &t->history;
    size_t const generations = (size_t)h->depth, n = (size_t)h->capacity, values = n * (size_t)h->fields;
    for (size_t i = 0; i < generations; i++) {
        int32_t count;
        memcpy(&count, in_body(t, body, &h->count[i]), sizeof count);
        if (count < 0 || count > h->capacity)
            return false;
    }
    for (size_t i = 0; i < generations * n; i++) {
        int32_t parent;
        memcpy(&parent, in_body(t, body, &h->parent[i]), sizeof parent);
        if (parent < 0 || parent >= h->capacity)
            return false;
    }
    for (size_t i = 0; i < generations * values; i++) {
        float v;
        memcpy(&v, in_body(t, body, &h->value[i]), sizeof v);
        if (!moderate(&v, 1))
            return false;
    }
    return true;
}

/* Ranges cover all n particles, block by block: each class in each hypothesis, in order. */
static bool strata_plausible(const gait_tracker *t, const strata *s, int32_t n)
{
    bool ok = s->count > 0 && s->count <= MAX_STRATA && s->count % t->model->classes == 0 && s->first[0] == 0;
    for (int32_t k = 0; ok && k < s->count; k++)
        ok = s->first[k + 1] > s->first[k] && s->first[k] % BLOCK == 0 &&
             s->motion_class[k] == k % t->model->classes;
    return ok && s->first[s->count] == n;
}

static bool classes_plausible(const gait_tracker *t, const unsigned char *body, const tracker_core *c)
{
    const particle_history *const h = &t->history;
    uint32_t const classes = (uint32_t)t->model->classes;
    class_state s;
    if (!t->classes || !c->started)
        return true;
    memcpy(&s, in_body(t, body, t->classes), sizeof s);
    bool ok = (uint32_t)s.reported < classes && (uint32_t)s.supported < classes &&
              (uint32_t)s.moved_class < classes && s.resampled >= 0 &&
              s.resampled <= c->utime - c->start_utime && s.moved >= 0 &&
              s.moved <= c->utime - c->start_utime &&
              moderate(s.score[0], GAIT_MAX_CLASSES * GAIT_MAX_COMPONENTS) && moderate(s.drift, 2);
    for (int32_t k = 0; ok && k < h->depth && ((uint64_t)k < c->frame || k == 0); k++) {
        int32_t const slot = history_slot(h, c->generation, k);
        int32_t count;
        strata of;
        memcpy(&count, in_body(t, body, &h->count[slot]), sizeof count);
        memcpy(&of, in_body(t, body, &h->strata[slot]), sizeof of);
        ok = strata_plausible(t, &of, count);
    }
    return ok;
}

static bool template_plausible(const gait_tracker *t, const unsigned char *body)
{
    for (int32_t k = 0; k < 2 * t->cfg.cameras; k++) {
        const int16_t *const template = t->template[k / t->cfg.cameras][k % t->cfg.cameras];
        for (int32_t i = 0; template && i < t->model->limbs * LIKE_SAMPLES; i++) {
            int16_t v;
            memcpy(&v, in_body(t, body, &template[i]), sizeof v);
            if (v != TEMPLATE_EMPTY && (v < -127 * TEMPLATE_ONE || v > 127 * TEMPLATE_ONE))
                return false;
        }
    }
    return true;
}

static bool walk_check_plausible(const gait_tracker *t, const unsigned char *body)
{
    walk_check w;
    if (!t->walk_check)
        return true;
    memcpy(&w, in_body(t, body, t->walk_check), sizeof w);
    return w.age >= 0 && (uint64_t)w.age < LONGEST_AGE && w.cameras >> t->cfg.cameras == 0 &&
           f_finite(&w.nats, 1) && moderate(w.body.f, F_MAX);
}

gait_result snapshot_restore(gait_tracker *t, const void *mem, size_t bytes, gait_error *err)
{
    const unsigned char *const body = (const unsigned char *)mem + sizeof(snapshot_header);
    snapshot_header h;
    if (bytes < sizeof h)
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "snapshot of %zu bytes is too short for its header",
                         bytes);
    memcpy(&h, mem, sizeof h);
    if (memcmp(h.magic, MAGIC, sizeof MAGIC) != 0)
        return base_fail(err, GAIT_ERR_MAGIC, -1, "these bytes are not a tracker snapshot");
    if (h.format != FORMAT || h.abi != GAIT_ABI || h.version != GAIT_VERSION)
        return base_fail(
            err, GAIT_ERR_VERSION, -1,
            "snapshot of format %u by library version %u, ABI %u; this is format %u, version %u, ABI %u",
            h.format, h.version, h.abi, (unsigned)FORMAT, (unsigned)GAIT_VERSION, (unsigned)GAIT_ABI);
    if (h.model != t->model->digest || h.config != config_digest(t))
        return base_fail(err, GAIT_ERR_VERSION, -1,
                         "snapshot of a tracker with another model or configuration");
    if (h.bytes != bytes || bytes != snapshot_bytes(t) || h.body != hash_state(body, state_bytes(t)))
        return base_fail(err, GAIT_ERR_CORRUPT, -1,
                         "snapshot is damaged: its length or checksum does not match");
    tracker_core core;
    memcpy(&core, body, sizeof core);
    if (!core_plausible(t, &core) || !weights_plausible(t, body, &core) ||
        !records_plausible(t, body, &core) || !history_plausible(t, body) ||
        !classes_plausible(t, body, &core) || !template_plausible(t, body) || !walk_check_plausible(t, body))
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "snapshot contains a number outside its range");
    memcpy(t->core, body, state_bytes(t));
    tracker_set_count(t, t->capacity - t->core->below_capacity);
    tracker_set_target(t, t->config_particles - t->core->below_config);
    for (int32_t c = 0; c < t->cfg.cameras; c++)
        t->camera[c].plate_stale = true;
    return GAIT_OK;
}

/* Times are taken relative to the start, so that the same walk at another time of day has the same digest. */
uint64_t snapshot_digest(const gait_tracker *t)
{
    unsigned char *const arrays = (unsigned char *)t->filter.log_weight; /* the core comes first */
    tracker_core core;
    memcpy(&core, t->core, sizeof core); /* with the padding, which is zero */
    core.utime -= core.start_utime;
    core.support_utime -= core.start_utime;
    core.rejuvenation_utime -= core.start_utime;
    core.hypotheses.since -= core.start_utime;
    core.start_utime = 0;
    uint64_t const small = hash_fnv1a(HASH_INIT, &core, sizeof core);
    return small ^ hash_state(arrays, (size_t)(t->state_end - arrays));
}
