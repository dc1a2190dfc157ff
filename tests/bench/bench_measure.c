#include "bench_measure.h"
#include "bench_clock.h"
#include "bench_limit.h"
#include "trackd/common.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_STEPS = 2000, TURN = 3 }; /* steps in a turn: only the first one finds no data in the caches */

typedef struct times { /* milliseconds of each step */
    double wall[MAX_STEPS], cpu[MAX_STEPS], limit_wall[MAX_STEPS], limit_cpu[2][MAX_STEPS];
    double stage[BENCH_STAGES][MAX_STEPS];
} times;

typedef struct runner { /* takes turns with others: a tracker, or two at the same time */
    bench_result *result;
    workers crew;
    unsigned char *memory;
    size_t each; /* bytes of memory per tracker */
    gait_tracker *tracker[2];
    int32_t frame, count; /* next frame of the scene; steps measured so far */
    times *spent;
    double limit_wall, limit_cpu[2]; /* nanoseconds, in this turn */
} runner;

static int32_t trackers(const runner *r)
{
    return r->result->plan.twins ? 2 : 1;
}

/* ---- one step ---- */
typedef struct job {
    const runner *r;
    gait_frame frame;
    gait_result status[2];
    gait_error err[2];
} job;

static void step_one(void *ctx, int32_t k)
{
    job *const j = ctx;
    gait_estimate estimate;
    j->status[k] = gait_tracker_step(j->r->tracker[k], &j->frame, &estimate, &j->err[k]);
}

static void step_all(const runner *r, job *j)
{
    gait_tasks const both = gait_pool_tasks(r->crew.pool);
    if (r->result->plan.twins)
        both.run(both.user, step_one, j, 2);
    else
        step_one(j, 0);
}

static void note_times(runner *r, double wall, double cpu)
{
    r->spent->wall[r->count] = wall * 1e-6;
    r->spent->cpu[r->count] = cpu * 1e-6;
    r->spent->limit_wall[r->count] = r->limit_wall * 1e-6;
    for (int k = 0; k < 2; k++)
        r->spent->limit_cpu[k][r->count] = r->limit_cpu[k] * 1e-6;
    for (int k = 0; k < BENCH_STAGES; k++)
        r->spent->stage[k][r->count] = bench_stages_take(k);
}

static bool step(runner *r, message *why)
{
    const bench_scene *const s = r->result->plan.scene;
    job j = {.r = r,
             .frame = {.utime = (int64_t)r->frame * 1000000 / 30, .image = {bench_scene_frame(s, r->frame)}}};
    int64_t const wall = bench_wall_ns(), cpu = bench_cpu_ns();
    step_all(r, &j);
    note_times(r, (double)(bench_wall_ns() - wall), (double)(bench_cpu_ns() - cpu));
    r->count += r->frame > 0; /* the first frame has no ancestors */
    for (int k = 0; k < trackers(r); k++)
        if (j.status[k] != GAIT_OK)
            return message_set(why, "%s: %s", gait_result_name(j.status[k]), j.err[k].text);
    return true;
}

/* ---- a turn ---- */
static bool start(const runner *r, message *why)
{
    gait_state const sd = bench_scene_start_sd(r->result->plan.search ? 0.5f : 0.05f);
    gait_error err = {.text = ""};
    for (int k = 0; k < trackers(r); k++)
        if (gait_tracker_start(r->tracker[k], &r->result->plan.scene->start, &sd, 0, &err) != GAIT_OK)
            return message_set(why, "%s", err.text);
    return true;
}

static double limit_ns(const bench_limit *limit, limit_kernel *kernel)
{
    int64_t const cpu = bench_cpu_ns();
    kernel(&limit->work);
    return (double)(bench_cpu_ns() - cpu);
}

static void run_limit(runner *r, const bench_limit *limit)
{
    int64_t const wall = bench_wall_ns();
    r->limit_cpu[0] = limit_ns(limit, limit->both);
    r->limit_wall = (double)(bench_wall_ns() - wall);
    if (r->result->plan.stages)
        r->limit_cpu[1] = limit_ns(limit, limit->kept);
}

/* From the start to the end of the scene, repeatedly, until there are enough steps. */
static bool take_turn(runner *r, int32_t steps, const bench_limit *limit, message *why)
{
    int32_t const frames = r->result->plan.scene->frames;
    bool ok = true;
    if (r->result->plan.limit)
        run_limit(r, limit);
    bench_stages_enable(r->tracker[0], r->result->plan.stages);
    for (int i = 0; ok && i < TURN && r->count < steps; i++) {
        ok = (r->frame > 0 || start(r, why)) && step(r, why);
        r->frame = (r->frame + 1) % frames;
        bool const first_round = r->count < frames;
        if (first_round && (r->frame == 0 || r->count == steps))
            r->result->digest = gait_tracker_digest(r->tracker[0]);
        r->result->particles = gait_tracker_particles(r->tracker[0], NULL, NULL, 0, NULL);
        if (ok && (r->result->particles > r->result->plan.particles) != r->result->plan.search)
            ok = message_set(why, "frame %d is tracked with %d particles", (int)r->frame,
                             (int)r->result->particles);
    }
    bench_stages_enable(r->tracker[0], false);
    return ok;
}

/* Every other time in the opposite order. */
static bool take_turns(runner *r, int32_t count, const bench_limit *limit, message *why)
{
    const bench_plan *const plan = &r->result->plan;
    int32_t const round = plan->scene->frames - 1, wanted = plan->rounds ? plan->rounds * round : plan->steps,
                  most = plan->rounds ? MAX_STEPS / round * round : MAX_STEPS,
                  steps = wanted < most ? wanted : most;
    bool ok = true;
    for (int32_t turn = 0; ok && r[0].count < steps; turn++)
        for (int32_t k = 0; ok && k < count; k++)
            ok = take_turn(&r[turn % 2 ? count - 1 - k : k], steps, limit, why);
    return ok;
}

/* ---- figures ---- */
static int ascending(const void *a, const void *b)
{
    double const x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double quantile(const double *values, int32_t count, double share)
{
    static double sorted[MAX_STEPS];
    memcpy(sorted, values, (size_t)count * sizeof *sorted);
    qsort(sorted, (size_t)count, sizeof *sorted, ascending);
    int32_t const at = (int32_t)(share * (double)count);
    return count ? sorted[at < count ? at : count - 1] : 0.0;
}

/* Step i of a round is one of the same frame in every round. */
static double slowest_frame(const double *ms, int32_t count, int32_t frames)
{
    static double least[MAX_STEPS];
    if (count < 2 * frames)
        return 0.0;
    memcpy(least, ms, (size_t)frames * sizeof *least);
    for (int32_t i = frames; i < count; i++)
        least[i % frames] = ms[i] < least[i % frames] ? ms[i] : least[i % frames];
    return quantile(least, frames, 1.0) / quantile(least, frames, 0.5);
}

static double particle_ms(const runner *r, int32_t step)
{
    return (r->spent->cpu[step] - r->spent->stage[STAGE_FEATURES][step]) / r->result->particles;
}

/* The likelihood stage to a limit of the same turn. */
static double stage_ratio(const runner *r, int which)
{
    static double ratio[MAX_STEPS];
    for (int32_t i = 0; i < r->count; i++)
        ratio[i] = r->spent->stage[STAGE_LIKELIHOOD][i] / r->spent->limit_cpu[which][i];
    return quantile(ratio, r->count, 0.5);
}

static void sum_up(const runner *r, const runner *first)
{
    static double ratio[MAX_STEPS], particle[MAX_STEPS], limit[MAX_STEPS];
    bench_result *const out = r->result;
    int32_t const frames = out->plan.scene->frames - 1;
    for (int32_t i = 0; i < r->count; i++) {
        ratio[i] = r->spent->wall[i] / first->spent->wall[i];
        particle[i] = particle_ms(r, i) / particle_ms(first, i);
        limit[i] = out->plan.limit ? r->spent->wall[i] / r->spent->limit_wall[i] : 0.0;
    }
    out->median_ms = quantile(r->spent->wall, r->count, 0.5);
    out->p99_ms = quantile(r->spent->wall, r->count, 0.99);
    out->cpu_ms = quantile(r->spent->cpu, r->count, 0.5);
    out->cpu_p99_ms = quantile(r->spent->cpu, r->count, 0.99);
    out->limit_ms = quantile(r->spent->limit_cpu[0], r->count, 0.5);
    out->kept_ms = quantile(r->spent->limit_cpu[1], r->count, 0.5);
    out->limit_p99_ms = quantile(r->spent->limit_cpu[0], r->count, 0.99);
    out->slowest = slowest_frame(r->spent->wall, r->count, frames);
    out->cpu_slowest = slowest_frame(r->spent->cpu, r->count, frames);
    out->limit_ratio = quantile(limit, r->count, 0.5);
    out->ratio = quantile(ratio, r->count, 0.5);
    out->particle_ratio = quantile(particle, r->count, 0.5);
    for (int k = 0; k < 2 && out->plan.limit && out->plan.stages; k++)
        out->stage_ratio[k] = stage_ratio(r, k);
    for (int k = 0; k < BENCH_STAGES; k++)
        out->stage_ms[k] = out->plan.stages ? quantile(r->spent->stage[k], r->count, 0.5) : 0.0;
}

/* ---- what is measured ---- */
static bool make_tracker(runner *r, int k, const gait_model *model, const gait_tracker_config *cfg,
                         const gait_image *plate, message *why)
{
    gait_error err = {.text = ""};
    return (gait_tracker_init(r->memory + (size_t)k * r->each, r->each, model, cfg, &r->tracker[k], &err) ==
                GAIT_OK &&
            gait_tracker_set_background(r->tracker[k], 0, plate, NULL) == GAIT_OK) ||
           message_set(why, "%s", err.text);
}

static bool make(runner *r, const gait_model *model, message *why)
{
    const bench_plan *const plan = &r->result->plan;
    const bench_scene *const s = plan->scene;
    gait_tracker_config cfg;
    gait_error err = {.text = ""};
    gait_image const plate = bench_scene_plate(s);
    if (!workers_start(&r->crew, plan->threads, why))
        return false;
    gait_tracker_default(&cfg, plan->mode);
    cfg.particles = plan->particles;
    cfg.camera[0] = s->camera;
    cfg.cpu_mask = plan->cpu_mask;
    cfg.tasks = plan->twins ? 1 : plan->threads;
    if (!plan->twins)
        cfg.exec = gait_pool_tasks(r->crew.pool);
    if (gait_tracker_bytes(model, &cfg, &r->result->bytes, &err) != GAIT_OK)
        return message_set(why, "%s", err.text);
    r->each = (r->result->bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN;
    r->memory = aligned_alloc(GAIT_ALIGN, r->each * (size_t)trackers(r));
    bool ok = r->memory || message_set(why, "not enough memory for %d particles", (int)plan->particles);
    for (int k = 0; ok && k < trackers(r); k++)
        ok = make_tracker(r, k, model, &cfg, &plate, why);
    return ok;
}

bool bench_measure(const gait_model *model, bench_result *results, int32_t count, message *why)
{
    static times spent[BENCH_TURNS];
    runner r[BENCH_TURNS] = {0};
    bench_limit limit = {0};
    bool ok = count <= BENCH_TURNS || message_set(why, "more than %d trackers in turns", BENCH_TURNS);
    ok = ok && bench_limit_make(&limit, ~0u, why);
    for (int32_t k = 0; ok && k < count; k++) {
        results[k].width = results[k].plan.scene->camera.width;
        results[k].height = results[k].plan.scene->camera.height;
        results[k].isa = gait_cpu_name(results[k].plan.cpu_mask);
        r[k] = (runner){.result = &results[k], .spent = &spent[k]};
        ok = make(&r[k], model, why);
    }
    ok = ok && take_turns(r, count, &limit, why);
    for (int32_t k = 0; ok && k < count; k++)
        sum_up(&r[k], &r[0]);
    bench_limit_free(&limit);
    for (int32_t k = 0; k < BENCH_TURNS; k++) {
        workers_stop(&r[k].crew);
        free(r[k].memory);
    }
    return ok;
}
