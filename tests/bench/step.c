/* step.c - speed of the tracker on a drawn walker: by instruction set, particles, threads and picture size, where the
 * time of a step goes, and how that compares with what was asked for. */
#include "bench_limit.h"
#include "bench_report.h"
#include "bench_verdict.h"
#include "common/file.h"
#include "common/options.h"
#include "gait_pool.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_SWEEP = 8, FRAMES = 90, LARGE_FRAMES = 30, MANY = 10000 };

typedef struct settings {
    char model[OPTION_TEXT], particles[OPTION_TEXT], threads[OPTION_TEXT], csv[OPTION_TEXT];
    int32_t steps;
} settings;

/* "100,1000" to numbers in [1, high]; returns how many, 0 if it is not such a list. */
static int numbers(const char *text, long high, int32_t out[MAX_SWEEP])
{
    int count = 0;
    for (char *end; count < MAX_SWEEP; text = end + 1) {
        long const v = strtol(text, &end, 10);
        if (end == text || v < 1 || v > high || (*end != ',' && *end != '\0'))
            return 0;
        out[count++] = (int32_t)v;
        if (*end == '\0')
            return count;
    }
    return 0;
}

typedef struct bench {
    const settings *set;
    const gait_model *model;
    bench_scene scene;
    verdict found;
    message *why;
} bench;

/* Steps enough for a stable figure, fewer where they are long. */
static int32_t steps_for(const bench *b, int32_t particles)
{
    int32_t const fewer = (int32_t)((int64_t)b->set->steps * MANY / particles);
    return particles <= MANY ? b->set->steps : fewer > 10 ? fewer : 10;
}

static const bench_result *run(bench *b, bench_plan plan)
{
    if (plan.steps == 0)
        plan.steps = steps_for(b, plan.particles);
    const bench_result *const r = bench_report_measure(b->model, &b->scene, &plan, b->why);
    if (r)
        bench_report_row(r);
    return r;
}

static bool same_bits(bench *b, const bench_result *x, const bench_result *y)
{
    return x->digest == y->digest ||
           message_set(b->why, "%d particles: the digest depends on threads or instruction set",
                       (int)x->plan.particles);
}

/* The settings in use: default and paper, on one core and two. */
static bool modes(bench *b)
{
    gait_tracker_config usual;
    gait_tracker_default(&usual, GAIT_MODE_DEFAULT);
    bench_report_head("modes, colour frames");
    b->found.usual = run(b, (bench_plan){.particles = usual.particles, .threads = 1, .cpu_mask = ~0u});
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++)
        for (int32_t threads = 1; threads <= 2; threads++) {
            bench_plan const plan = {.mode = mode, .particles = MANY, .threads = threads, .cpu_mask = ~0u};
            if (!(b->found.many[mode][threads - 1] = run(b, plan)))
                return false;
        }
    return b->found.usual && same_bits(b, b->found.many[0][0], b->found.many[0][1]) &&
           same_bits(b, b->found.many[1][0], b->found.many[1][1]);
}

/* The same with each instruction set, with the stages' times. */
static bool instruction_sets(bench *b)
{
    static const uint32_t masks[] = {0, GAIT_CPU_BASE, GAIT_CPU_BASE | GAIT_CPU_AVX2,
                                     GAIT_CPU_BASE | GAIT_CPU_AVX2 | GAIT_CPU_AVX512};
    int32_t const steps = b->set->steps < 40 ? b->set->steps : 40;
    int count = 0;
    bench_report_head("instruction sets, with the stages timed");
    for (size_t k = 0; k < sizeof masks / sizeof *masks; k++) {
        bench_plan const plan = {
            .particles = MANY, .threads = 1, .cpu_mask = masks[k], .steps = steps, .stages = true};
        if (masks[k] & ~gait_cpu_features())
            continue;
        if (!(b->found.isa[count] = run(b, plan)) || !same_bits(b, b->found.isa[0], b->found.isa[count]))
            return false;
        count++;
    }
    b->found.isas = count;
    bench_report_stages(b->found.isa, count);
    return true;
}

static bool sweep(bench *b)
{
    int32_t particles[MAX_SWEEP], threads[MAX_SWEEP];
    int const sizes = numbers(b->set->particles, 1 << 20, particles),
              counts = numbers(b->set->threads, GAIT_POOL_MAX, threads);
    if (!sizes || !counts)
        return message_set(b->why, "--particles and --threads want up to %d numbers like 100,1000",
                           MAX_SWEEP);
    bench_report_head("particles and threads");
    for (int i = 0; i < sizes; i++) {
        const bench_result *first = NULL;
        for (int k = 0; k < counts; k++) {
            const bench_result *const r = run(b, (bench_plan){.particles = particles[i],
                                                              .threads = threads[k],
                                                              .cpu_mask = ~0u,
                                                              .stages = threads[k] == 1});
            if (!r || (first && !same_bits(b, first, r)))
                return false;
            if (!first)
                first = r;
            if (threads[k] == 1)
                verdict_size(&b->found, r);
        }
    }
    return true;
}

/* A person of the same size in larger pictures. */
static bool pictures(bench *b)
{
    static const int32_t size[][2] = {{640, 480}, {1280, 720}, {1920, 1080}};
    bench_report_head("picture size, the person as large in all");
    for (int k = 0; k < 3; k++) {
        bench_plan const plan = {.particles = 1500, .threads = 1, .cpu_mask = ~0u, .stages = true};
        bench_scene_free(&b->scene);
        if (!bench_scene_make(&b->scene, b->model, size[k][0], size[k][1], LARGE_FRAMES, b->why) ||
            !(b->found.picture[k] = run(b, plan)))
            return false;
    }
    bench_report_stages(b->found.picture, 3);
    return true;
}

static bool limit(bench *b)
{
    static const uint32_t masks[] = {0, GAIT_CPU_BASE, GAIT_CPU_BASE | GAIT_CPU_AVX2, ~0u};
    printf(
        "\ntexture-only limit, %d particles x %d limbs x %d samples, CPU ms: two look-ups, ancestor kept\n",
        LIMIT_PARTICLES, LIMIT_LIMBS, LIMIT_SAMPLES);
    for (size_t k = 0; k < sizeof masks / sizeof *masks; k++) {
        if (masks[k] != ~0u && (masks[k] & ~gait_cpu_features()))
            continue;
        if (!bench_limit(masks[k], &b->found.limit_ms, &b->found.kept_ms, b->why))
            return false;
        const char *const isa = gait_cpu_name(masks[k]);
        bench_report_add("limit_both", isa, b->found.limit_ms);
        bench_report_add("limit_kept", isa, b->found.kept_ms);
        printf("%-7s %8.2f %8.2f\n", isa, b->found.limit_ms, b->found.kept_ms);
    }
    return true;
}

static bool measure(const settings *set, const gait_model *model, message *why)
{
    static bench b;
    b = (bench){.set = set, .model = model, .why = why};
    bool const ok = bench_scene_make(&b.scene, model, 640, 480, FRAMES, why) && modes(&b) &&
                    instruction_sets(&b) && sweep(&b) && pictures(&b) && limit(&b);
    bench_scene_free(&b.scene);
    if (ok)
        verdict_print(&b.found, model);
    return ok && (!set->csv[0] || bench_report_csv(set->csv, why));
}

static bool bench_model(const settings *set, message *why)
{
    file_bytes blob;
    gait_error err = {.text = ""};
    gait_model *model = NULL;
    size_t bytes = 0;
    if (!file_read(set->model, "model", &blob, why))
        return false;
    bool ok = gait_model_bytes(blob.data, blob.size, &bytes, &err) == GAIT_OK;
    void *const memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN) / GAIT_ALIGN * GAIT_ALIGN);
    ok = ok && memory && gait_model_init(memory, bytes, blob.data, blob.size, &model, &err) == GAIT_OK;
    ok = ok ? measure(set, model, why) : message_set(why, "%s: %s", set->model, err.text);
    free(memory);
    free(blob.data);
    return ok;
}

int main(int argc, char **argv)
{
    settings set = {"python/gait/data/walk.gait", "1000,3000,10000,30000,100000", "1,2", "", 80};
    const option table[] = {
        {"model", 'm', "FILE", "model blob", OPTION_TEXTUAL, set.model, 0, 0},
        {"particles", 'n', "N,N...", "numbers of particles, default 1000,3000,10000,30000,100000",
         OPTION_TEXTUAL, set.particles, 0, 0},
        {"threads", 't', "N,N...", "numbers of threads, default 1,2", OPTION_TEXTUAL, set.threads, 0, 0},
        {"steps", 's', "N", "steps of a measurement, default 80 (fewer above 10000 particles)", OPTION_INT,
         &set.steps, 10, 2000},
        {"csv", 0, "FILE", "write every figure there", OPTION_TEXTUAL, set.csv, 0, 0},
    };
    int const count = sizeof table / sizeof *table;
    message why = {""};
    option_result const parsed = options_parse(table, count, argc, argv, &why);
    if (parsed == OPTION_HELP) {
        printf("usage: step [options]\n\nTime the tracker on a drawn walker.\n\n");
        options_help(table, count);
        return 0;
    }
    if (parsed == OPTION_BAD || !bench_model(&set, &why)) {
        fprintf(stderr, "step: %s\n", why.text);
        return parsed == OPTION_BAD ? 2 : 1;
    }
    return 0;
}
