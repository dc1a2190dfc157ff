#include "bench_stages.h"
#include "bench_clock.h"
#include "tracker/estimate.h"
#include "tracker/features_step.h"
#include "tracker/fixed_lag.h"
#include "tracker/front_back.h"
#include "tracker/hypotheses.h"
#include "tracker/likelihood_step.h"
#include "tracker/track_loss.h"

const char *const bench_stage_name[BENCH_STAGES] = {
    [STAGE_FEATURES] = "features",     [STAGE_RESAMPLE] = "resample",     [STAGE_PROPAGATE] = "propagate",
    [STAGE_LIKELIHOOD] = "likelihood", [STAGE_KINEMATICS] = "kinematics", [STAGE_PROJECTION] = "projection",
    [STAGE_RASTER] = "raster",         [STAGE_SAMPLES] = "samples",       [STAGE_TEXTURE] = "texture",
    [STAGE_SILHOUETTE] = "silhouette", [STAGE_EDGES] = "edges",           [STAGE_TEMPLATE] = "template",
    [STAGE_WEIGHTS] = "weights",       [STAGE_ESTIMATE] = "estimate",     [STAGE_LAG] = "lag",
};

static struct {
    bool on, in_likelihood;     /* in_likelihood: on, and inside the particles' likelihood */
    int within;                 /* whole stages that have begun, */
    double inner_ns;            /* and the time of those that began within the last */
    const kernels *plain;       /* of the tracker */
    kernels timed;              /* the same with the functions below */
    double ms_per_tick, cost;   /* a tick; ticks that timing takes */
    double ns[BENCH_STAGES];    /* of whole stages, */
    double ticks[BENCH_STAGES]; /* and of parts of the likelihood */
    double cells, bodies;       /* of the silhouettes counted */
    double surface, edges;      /* visible points of every SPARSE-th body */
    int64_t evaluated, counted; /* bodies; those whose points were counted */
} b;

enum { SPARSE = 64 }; /* counting takes time, which must not count for the stages */

/* ---- clocks: the thread's for whole stages, the CPU's counter for their parts, which are short ---- */
static uint64_t now(void)
{
#if defined(__x86_64__)
    return __builtin_ia32_rdtsc();
#elif defined(__aarch64__)
    uint64_t ticks;
    __asm__ volatile("mrs %0, cntvct_el0" : "=r"(ticks));
    return ticks;
#else
    return (uint64_t)bench_wall_ns();
#endif
}

/* Time that other programs used in between does not count. */
static void add(int stage, uint64_t begin)
{
    double const ticks = (double)(now() - begin) - b.cost;
    if (ticks * b.ms_per_tick < 0.2)
        b.ticks[stage] += ticks;
}

static void calibrate(void)
{
    enum { ROUNDS = 1000 };
    int64_t const wall = bench_wall_ns();
    uint64_t const begin = now();
    while (bench_wall_ns() - wall < 20000000)
        ;
    b.ms_per_tick = (double)(bench_wall_ns() - wall) * 1e-6 / (double)(now() - begin);
    b.cost = 1e9;
    for (int i = 0; i < ROUNDS; i++) {
        uint64_t const start = now();
        double const ticks = (double)(now() - start);
        b.cost = ticks < b.cost ? ticks : b.cost;
    }
}

/* `call`, timed as part of the likelihood. */
#define PART(stage, call)                                                                                    \
    do {                                                                                                     \
        uint64_t const since_ = b.in_likelihood ? now() : 0;                                                 \
        call;                                                                                                \
        if (b.in_likelihood)                                                                                 \
            add(stage, since_);                                                                              \
    } while (0)

/* ---- kernels ---- */
static void outline_project(const struct limb_geometry *limbs, int32_t count, const struct kin_body *body,
                            const gait_camera *cam, const struct view_map *map, struct outline_block *out)
{
    PART(STAGE_PROJECTION, b.plain->outline_project(limbs, count, body, cam, map, out));
}

static void layers_prepare(const struct outline_block *outline, const struct limb_geometry *limbs,
                           int32_t count, struct layers_block *out)
{
    PART(STAGE_PROJECTION, b.plain->layers_prepare(outline, limbs, count, out));
}

static void layers_draw(const struct layers_block *block, int32_t lane, struct layers *out)
{
    PART(STAGE_RASTER, b.plain->layers_draw(block, lane, out));
}

static void silhouette_count(const struct features *f, const struct grid_mask *whole, int32_t *area,
                             int32_t *covered)
{
    PART(STAGE_SILHOUETTE, b.plain->silhouette_count(f, whole, area, covered));
    b.cells += (double)(*area / FOREGROUND_ONE);
    b.bodies++;
}

static int32_t shown_of(const struct like_body *body)
{
    int32_t shown = 0;
    for (int32_t l = 0; l < body->setup->limbs; l++)
        for (int i = 0; i < LIKE_HALF; i++)
            shown += body->samples[l].value[i] != TEXTURE_HIDDEN;
    return shown;
}

static void edges_count(const struct like_body *body, struct like_edge_tally *out)
{
    b.plain->edges_count(body, out);
    if (b.evaluated++ % SPARSE == 0 && body->samples) {
        b.surface += shown_of(body);
        b.edges += out->points;
        b.counted++;
    }
}

static void edges_prepare(const struct outline_block *outline, const struct limb_geometry *limbs,
                          int32_t count, struct like_outline *out)
{
    PART(STAGE_EDGES, b.plain->edges_prepare(outline, limbs, count, out));
}

static void surface_pose(const struct like_setup *s, const gait_camera *cam, const struct view_map *map,
                         const struct kin_body *body, struct like_pose *out)
{
    PART(STAGE_SAMPLES, b.plain->surface_pose(s, cam, map, body, out));
}

static void surface_sample(const struct like_setup *s, const struct features *f, const struct like_pose *pose,
                           int32_t lane, const struct layers *drawn, struct like_patch *out)
{
    PART(STAGE_SAMPLES, b.plain->surface_sample(s, f, pose, lane, drawn, out));
}

static void texture_costs(const struct like_body *body, int32_t (*cost)[BLOCK])
{
    PART(STAGE_TEXTURE, b.plain->texture_costs(body, cost));
}

static void texture_logs(const struct like_setup *s, const struct outline_block *outline,
                         const int32_t (*cost)[BLOCK], float *log)
{
    PART(STAGE_TEXTURE, b.plain->texture_logs(s, outline, cost, log));
}

static int64_t template_cost(const struct like_body *body)
{
    int64_t sum;
    PART(STAGE_TEMPLATE, sum = b.plain->template_cost(body));
    return sum;
}

void bench_stages_enable(gait_tracker *t, bool on)
{
    if (on && b.ms_per_tick == 0.0)
        calibrate();
    if (on == b.on)
        return;
    b.on = on;
    if (on) {
        b.plain = t->like->run;
        b.timed = *b.plain;
        b.timed.outline_project = outline_project;
        b.timed.layers_prepare = layers_prepare;
        b.timed.layers_draw = layers_draw;
        b.timed.silhouette_count = silhouette_count;
        b.timed.edges_prepare = edges_prepare;
        b.timed.edges_count = edges_count;
        b.timed.surface_pose = surface_pose;
        b.timed.surface_sample = surface_sample;
        b.timed.texture_costs = texture_costs;
        b.timed.texture_logs = texture_logs;
        b.timed.template_cost = template_cost;
    }
    t->like->run = on ? &b.timed : b.plain;
}

double bench_stages_take(int stage)
{
    double const ms = b.ns[stage] * 1e-6 + b.ticks[stage] * b.ms_per_tick;
    b.ns[stage] = b.ticks[stage] = 0.0;
    return ms;
}

bench_samples bench_stages_samples(void)
{
    double const bodies = b.bodies > 0.0 ? b.bodies : 1.0, counted = b.counted > 0 ? (double)b.counted : 1.0;
    return (bench_samples){b.cells / bodies, b.surface / counted, b.edges / counted};
}

/* ---- functions of the library (-Wl,--wrap) ---- */
static void stage_begin(double *outer_ns, int64_t *since)
{
    *outer_ns = b.inner_ns;
    b.inner_ns = 0.0;
    b.within++;
    *since = bench_cpu_ns();
}

static void stage_end(int stage, double outer_ns, int64_t since)
{
    double const all = (double)(bench_cpu_ns() - since);
    b.within--;
    b.ns[stage] += all - b.inner_ns;
    b.inner_ns = outer_ns + all;
}

/* `call`, timed as a stage without the stages within it; untimed it may be made by several threads. */
#define WHOLE(stage, call)                                                                                   \
    do {                                                                                                     \
        double outer_ = 0.0;                                                                                 \
        int64_t since_ = 0;                                                                                  \
        if (b.on)                                                                                            \
            stage_begin(&outer_, &since_);                                                                   \
        call;                                                                                                \
        if (b.on)                                                                                            \
            stage_end(stage, outer_, since_);                                                                \
    } while (0)
#define WRAP(result, name, parameters)                                                                       \
    result __real_##name parameters;                                                                         \
    result __wrap_##name parameters;                                                                         \
    result __wrap_##name parameters

WRAP(int32_t, features_step, (gait_tracker * t, const gait_frame *frame, const particle_state *predicted))
{
    int32_t cameras;
    WHOLE(STAGE_FEATURES, cameras = __real_features_step(t, frame, predicted));
    return cameras;
}

WRAP(void, pf_inherit, (pf * p, int32_t before, void *array, size_t bytes))
{
    WHOLE(STAGE_RESAMPLE, __real_pf_inherit(p, before, array, bytes));
}

WRAP(bool, hypotheses_resample, (gait_tracker * t, uint32_t counter))
{
    bool done;
    WHOLE(STAGE_RESAMPLE, done = __real_hypotheses_resample(t, counter));
    return done;
}

WRAP(void, likelihood_step, (gait_tracker * t))
{
    b.in_likelihood = b.on;
    WHOLE(STAGE_LIKELIHOOD, __real_likelihood_step(t));
    b.in_likelihood = false;
}

/* Tasks outside all stages predict the particles, or begin stages themselves. */
WRAP(void, task_run_beside,
     (const gait_tasks *exec, int32_t tasks, void (*beside)(void *ctx), int32_t items, int32_t block,
      task_range_fn *fn, void *ctx))
{
    if (b.in_likelihood || b.within)
        __real_task_run_beside(exec, tasks, beside, items, block, fn, ctx);
    else
        WHOLE(STAGE_PROPAGATE, __real_task_run_beside(exec, tasks, beside, items, block, fn, ctx));
}

WRAP(void, task_run,
     (const gait_tasks *exec, int32_t tasks, int32_t items, int32_t block, task_range_fn *fn, void *ctx))
{
    __wrap_task_run_beside(exec, tasks, NULL, items, block, fn, ctx);
}

WRAP(pf_summary, hypotheses_update, (gait_tracker * t, float dt))
{
    pf_summary s;
    WHOLE(STAGE_WEIGHTS, s = __real_hypotheses_update(t, dt));
    return s;
}

WRAP(void, track_loss_bound, (gait_tracker * t))
{
    WHOLE(STAGE_WEIGHTS, __real_track_loss_bound(t));
}

WRAP(particle_state, particle_set_place, (const particle_set *particles, const double *weight))
{
    particle_state p;
    WHOLE(STAGE_ESTIMATE, p = __real_particle_set_place(particles, weight));
    return p;
}

WRAP(particle_state, estimate_particles, (gait_tracker * t, int32_t best, gait_estimate *out))
{
    particle_state p;
    WHOLE(STAGE_ESTIMATE, p = __real_estimate_particles(t, best, out));
    return p;
}

WRAP(track_loss_verdict, track_loss_check,
     (gait_tracker * t, bool lost, const state_layout *of, const particle_state *mean))
{
    track_loss_verdict v;
    WHOLE(STAGE_ESTIMATE, v = __real_track_loss_check(t, lost, of, mean));
    return v;
}

WRAP(float, front_back_update,
     (gait_tracker * t, bool restart, const state_layout *of, const particle_state *mean))
{
    float margin;
    WHOLE(STAGE_ESTIMATE, margin = __real_front_back_update(t, restart, of, mean));
    return margin;
}

WRAP(void, fixed_lag_record, (gait_tracker * t, const gait_estimate *e))
{
    WHOLE(STAGE_LAG, __real_fixed_lag_record(t, e));
}

/* Parts of the likelihood that are not kernels. */
WRAP(void, particle_set_bodies, (const state_layout *r, const particle_set *p, int32_t begin, kin_body *out))
{
    PART(STAGE_KINEMATICS, __real_particle_set_bodies(r, p, begin, out));
}

WRAP(void, kin_points, (const gait_model *m, const kin_body *body, float (*xyz)[3][BLOCK]))
{
    PART(STAGE_KINEMATICS, __real_kin_points(m, body, xyz));
}

/* The terms: time that the kernels of the others do not take belongs to the edges. */
WRAP(void, like_evaluate, (const like_body *body))
{
    double const others = b.ticks[STAGE_TEXTURE] + b.ticks[STAGE_SILHOUETTE] + b.ticks[STAGE_TEMPLATE];
    PART(STAGE_EDGES, __real_like_evaluate(body));
    b.ticks[STAGE_EDGES] +=
        others - b.ticks[STAGE_TEXTURE] - b.ticks[STAGE_SILHOUETTE] - b.ticks[STAGE_TEMPLATE];
}
