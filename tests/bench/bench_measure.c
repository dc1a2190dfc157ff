#include "bench_measure.h"
#include "bench_clock.h"
#include "common/workers.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_STEPS = 2000 };

typedef struct times { /* of each step, milliseconds */
    int32_t count;
    double wall[MAX_STEPS], cpu[MAX_STEPS], stage[BENCH_STAGES][MAX_STEPS];
} times;

static int ascending(const void *a, const void *b)
{
    double const x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Sorts the values. */
static double quantile(double *values, int32_t count, double share)
{
    qsort(values, (size_t)count, sizeof *values, ascending);
    int32_t const at = (int32_t)(share * (double)count);
    return count ? values[at < count ? at : count - 1] : 0.0;
}

/* From the start to the scene's end, or until enough steps are there. */
static gait_status once(gait_tracker *t, const bench_scene *s, int32_t steps, times *out, gait_error *err)
{
    gait_state const sd = {.phase = 0.05f,
                           .stride_hz = 0.05f,
                           .stature = 0.03f,
                           .heading = 0.1f,
                           .pelvis = {0.05f, 0.05f, 0.02f},
                           .pitch = 0.02f,
                           .roll = 0.02f};
    gait_estimate estimate;
    gait_status status = gait_tracker_start(t, &s->start, &sd, 0, err);
    for (int32_t f = 0; f < s->frames && out->count < steps && status == GAIT_OK; f++) {
        gait_frame const frame = {.utime = (int64_t)f * 1000000 / 30, .image = {bench_scene_frame(s, f)}};
        int64_t const wall = bench_wall_ns(), cpu = bench_cpu_ns();
        status = gait_tracker_step(t, &frame, &estimate, err);
        out->cpu[out->count] = (double)(bench_cpu_ns() - cpu) * 1e-6;
        out->wall[out->count] = (double)(bench_wall_ns() - wall) * 1e-6;
        for (int k = 0; k < BENCH_STAGES; k++)
            out->stage[k][out->count] = bench_stages_take(k);
        out->count += f > 0; /* the first frame has no ancestors */
    }
    return status;
}

static gait_status track(gait_tracker *t, const bench_scene *s, const bench_plan *plan, bench_result *out,
                         gait_error *err)
{
    static times all;
    gait_image const plate = bench_scene_plate(s);
    int32_t const steps = plan->steps < MAX_STEPS ? plan->steps : MAX_STEPS;
    gait_status status = gait_tracker_set_background(t, 0, &plate);
    all.count = 0;
    bench_stages_enable(t, plan->stages);
    while (status == GAIT_OK && all.count < steps) {
        bool const first = all.count == 0;
        status = once(t, s, steps, &all, err);
        if (first)
            out->digest = gait_tracker_digest(t);
    }
    bench_stages_enable(t, false);
    out->median_ms = quantile(all.wall, all.count, 0.5);
    out->p99_ms = quantile(all.wall, all.count, 0.99);
    out->cpu_ms = quantile(all.cpu, all.count, 0.5);
    out->cpu_p99_ms = quantile(all.cpu, all.count, 0.99);
    for (int k = 0; k < BENCH_STAGES; k++)
        out->stage_ms[k] = plan->stages ? quantile(all.stage[k], all.count, 0.5) : 0.0;
    return status;
}

bool bench_measure(const gait_model *model, const bench_scene *s, const bench_plan *plan, bench_result *out,
                   message *why)
{
    workers crew;
    gait_tracker_config cfg;
    gait_error err = {.text = ""};
    gait_tracker *tracker = NULL;
    *out = (bench_result){.plan = *plan, .width = s->camera.width, .height = s->camera.height};
    gait_tracker_default(&cfg, plan->mode);
    cfg.particles = plan->particles;
    cfg.camera[0] = s->camera;
    cfg.cpu_mask = plan->cpu_mask;
    cfg.tasks = plan->threads;
    out->isa = gait_cpu_name(plan->cpu_mask);
    if (!workers_start(&crew, plan->threads, why))
        return false;
    cfg.exec = gait_pool_tasks(crew.pool);
    gait_status status = gait_tracker_bytes(model, &cfg, &out->bytes, &err);
    void *const memory = aligned_alloc(GAIT_ALIGN, (out->bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
    if (status == GAIT_OK)
        status =
            memory ? gait_tracker_init(memory, out->bytes, model, &cfg, &tracker, &err) : GAIT_ERR_MEMORY;
    if (status == GAIT_OK)
        status = track(tracker, s, plan, out, &err);
    workers_stop(&crew);
    free(memory);
    return status == GAIT_OK || message_set(why, "%s: %s", gait_status_name(status), err.text);
}
