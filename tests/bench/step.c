/* step.c - speed of the tracker on a drawn person: by instruction set, particles, threads and picture size, where the
 * time of a step goes, and how that compares with what was asked for. */
#include "bench_limit.h"
#include "bench_report.h"
#include "bench_verdict.h"
#include "trackd/common.h"
#include "trackd/options.h"
#include "gait_pool.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FRAMES = 90, SEARCH_FRAMES = 30, LARGE_FRAMES = 30, MANY = 10000 };

typedef struct settings {
    char model[OPTION_TEXT], particles[OPTION_TEXT], threads[OPTION_TEXT], csv[OPTION_TEXT];
    int32_t steps;
    int32_t particles_of[BENCH_TURNS], threads_of[BENCH_TURNS]; /* the lists above, as numbers */
    int sizes, threadings;
} settings;

/* "100,1000" to numbers in [low, high]; false, with the reason, if it is not such a list. */
static bool numbers(const char *name, const char *text, long low, long high, int32_t out[BENCH_TURNS],
                    int *count, message *why)
{
    const char *at = text;
    *count = 0;
    for (char *end; *count < BENCH_TURNS; at = end + 1) {
        long const v = strtol(at, &end, 10);
        if (end == at || v < low || v > high || (*end != ',' && *end != '\0'))
            break;
        out[(*count)++] = (int32_t)v;
        if (*end == '\0')
            return true;
    }
    return message_set(why, "%s %.80s: give one to %d numbers from %ld to %ld with commas between", name,
                       text, BENCH_TURNS, low, high);
}

/* What the table of options cannot check, before anything is measured. */
static bool check(settings *set, message *why)
{
    return numbers("--particles", set->particles, 16, 1 << 20, set->particles_of, &set->sizes, why) &&
           numbers("--threads", set->threads, 1, GAIT_POOL_MAX, set->threads_of, &set->threadings, why) &&
           (!set->csv[0] || bench_report_can_write(set->csv, why));
}

typedef struct bench {
    const settings *set;
    const gait_model *model;
    bench_scene scene;
    verdict found;
    message *why;
} bench;

/* Enough steps for a stable figure, fewer if they are long. */
static int32_t steps_for(const bench *b, int32_t particles)
{
    enum { LEAST = 24 };
    int32_t const fewer = (int32_t)((int64_t)b->set->steps * MANY / particles);
    return particles <= MANY ? b->set->steps : fewer > LEAST ? fewer : LEAST;
}

/* Trackers that take turns, before the common scene if they have none of their own; as many steps each as the first
 * one's number of particles allows. */
static const bench_result *run(bench *b, bench_plan *plans, int32_t count)
{
    if (plans->steps == 0 && plans->rounds == 0)
        plans->steps = steps_for(b, plans->particles);
    for (int32_t k = 0; k < count; k++)
        plans[k].scene = plans[k].scene ? plans[k].scene : &b->scene;
    const bench_result *const r = bench_report_measure(b->model, plans, count, b->why);
    if (r)
        bench_report_rows(r, count);
    return r;
}

static bool same_bits(bench *b, const bench_result *x, const bench_result *y)
{
    return x->digest == y->digest ||
           message_set(b->why, "%d particles: the digest depends on threads or instruction set",
                       (int)x->plan.particles);
}

/* Whole rounds, as many as a 99th percentile and a frame's shortest time need. */
static int32_t rounds_of(const bench *b, int32_t frames)
{
    enum { ROUNDS = 5 };
    int32_t const steps = b->set->steps > FRAMES ? b->set->steps : FRAMES;
    return ROUNDS * steps / frames;
}

/* One core and two, with the default number of particles. */
static bool usual(bench *b, const bench_scene *scene, bool search, by_threads *out)
{
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    bench_plan plans[2];
    plans[0] = plans[1] = (bench_plan){.scene = scene,
                                       .particles = cfg.particles,
                                       .threads = 1,
                                       .cpu_mask = ~0u,
                                       .rounds = rounds_of(b, scene->frames),
                                       .limit = true,
                                       .search = search};
    plans[1].threads = 2;
    const bench_result *const r = run(b, plans, 2);
    if (!r || !same_bits(b, &r[0], &r[1]))
        return false;
    *out = (by_threads){.one = &r[0], .two = &r[1]};
    return true;
}

/* The settings in use: default, also while it searches, and paper, on one core and two; and what two trackers do at the
 * same time. */
static bool modes(bench *b)
{
    int32_t const rounds = rounds_of(b, FRAMES);
    bench_scene opening = b->scene;
    opening.frames = SEARCH_FRAMES;
    bench_report_head("modes", "modes, colour frames");
    if (!usual(b, &b->scene, false, &b->found.usual) || !usual(b, &opening, true, &b->found.search))
        return false;
    for (int32_t mode = GAIT_MODE_DEFAULT; mode <= GAIT_MODE_PAPER; mode++) {
        bench_plan const one = {
            .mode = mode, .particles = MANY, .threads = 1, .cpu_mask = ~0u, .rounds = rounds, .limit = true};
        bench_plan plans[] = {one, one, one};
        plans[1].threads = plans[2].threads = 2;
        plans[2].twins = true;
        plans[2].limit = false;
        bool const twins = mode == GAIT_MODE_DEFAULT;
        const bench_result *const r = run(b, plans, twins ? 3 : 2);
        if (!r || !same_bits(b, &r[0], &r[1]))
            return false;
        b->found.many[mode] = (by_threads){.one = &r[0], .two = &r[1], .twins = twins ? &r[2] : NULL};
    }
    return true;
}

static const uint32_t set_masks[BENCH_SETS] = {0, GAIT_CPU_BASE, GAIT_CPU_BASE | GAIT_CPU_SSE4,
                                               GAIT_CPU_BASE | GAIT_CPU_AVX2,
                                               GAIT_CPU_BASE | GAIT_CPU_AVX2 | GAIT_CPU_AVX512};

/* The same with each instruction set, with the stages' times. */
static bool instruction_sets(bench *b)
{
    bench_plan plans[BENCH_SETS];
    int count = 0;
    for (int k = 0; k < BENCH_SETS; k++)
        if (!(set_masks[k] & ~gait_cpu_features()))
            plans[count++] =
                (bench_plan){.particles = MANY, .threads = 1, .cpu_mask = set_masks[k], .stages = true};
    plans[count - 1].limit = true;
    plans[0].steps = b->set->steps < 40 ? b->set->steps : 40;
    bench_report_head("isa", "instruction sets, with the stages timed");
    const bench_result *const r = run(b, plans, count);
    for (int k = 0; k < count; k++) {
        if (!r || !same_bits(b, &r[0], &r[k]))
            return false;
        b->found.isa[k] = &r[k];
    }
    b->found.isas = count;
    bench_report_stages(b->found.isa, count);
    return true;
}

/* The default number of particles and fewer, with the instruction sets of smaller computers: neither the scalar
 * definition nor the best set, which the modes are measured with. */
static bool small_computers(bench *b)
{
    enum { FEW = 500 };
    gait_tracker_config cfg;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    bench_plan plans[2 * BENCH_SETS];
    int const sets = b->found.isas - 2;
    _Static_assert(2 * (BENCH_SETS - 2) <= BENCH_TURNS, "all can take turns");
    if (sets < 1)
        return true;
    for (int k = 0; k < 2 * sets; k++)
        plans[k] = (bench_plan){.particles = k < sets ? cfg.particles : FEW,
                                .threads = 1,
                                .cpu_mask = b->found.isa[1 + k % sets]->plan.cpu_mask};
    bench_report_head("small", "instruction sets, fewer particles");
    const bench_result *const r = run(b, plans, 2 * sets);
    for (int k = 0; k < 2 * sets; k++) {
        if (!r || !same_bits(b, &r[k < sets ? 0 : sets], &r[k]))
            return false;
        b->found.slow[k / sets][k % sets] = &r[k];
    }
    b->found.slows = sets;
    return true;
}

/* Numbers of particles on one core, with the stages' times; as many steps of each as of the most. */
static bool sizes(bench *b, const int32_t *particles, int count)
{
    const bench_result *of[BENCH_TURNS];
    bench_plan plans[BENCH_TURNS];
    for (int k = 0; k < count; k++) {
        plans[k] = (bench_plan){.particles = particles[k], .threads = 1, .cpu_mask = ~0u, .stages = true};
        int32_t const steps = steps_for(b, particles[k]);
        plans[0].steps = k == 0 || steps < plans[0].steps ? steps : plans[0].steps;
    }
    bench_report_head("particles", "particles, with the stages timed");
    const bench_result *const r = run(b, plans, count);
    for (int k = 0; r && k < count; k++) {
        of[k] = &r[k];
        verdict_size(&b->found, &r[k]);
    }
    if (r)
        bench_report_stages(of, count);
    return r;
}

static bool threads_of(bench *b, int32_t particles, const int32_t *threads, int count)
{
    bench_plan plans[BENCH_TURNS];
    for (int k = 0; k < count; k++)
        plans[k] = (bench_plan){.particles = particles, .threads = threads[k], .cpu_mask = ~0u};
    const bench_result *const r = run(b, plans, count);
    for (int k = 1; r && k < count; k++)
        if (!same_bits(b, &r[0], &r[k]))
            return false;
    return r;
}

static bool sweep(bench *b)
{
    const settings *const set = b->set;
    bool ok = sizes(b, set->particles_of, set->sizes);
    bench_report_head("threads", "particles and threads");
    for (int i = 0; ok && i < set->sizes; i++)
        ok = threads_of(b, set->particles_of[i], set->threads_of, set->threadings);
    return ok;
}

/* A person of the same size in larger pictures, which take turns. */
static bool pictures(bench *b)
{
    enum { SIZES = 3 };
    static const int32_t size[SIZES][2] = {{640, 480}, {1280, 720}, {1920, 1080}};
    bench_scene scenes[SIZES] = {0};
    bench_plan plans[SIZES];
    bool ok = true;
    bench_report_head("pictures", "picture size, the person as large in all, with the stages timed");
    for (int k = 0; ok && k < SIZES; k++) {
        ok = bench_scene_make(&scenes[k], b->model, size[k][0], size[k][1], LARGE_FRAMES, b->why);
        plans[k] = (bench_plan){
            .scene = &scenes[k], .particles = 2000, .threads = 1, .cpu_mask = ~0u, .stages = true};
    }
    const bench_result *const r = ok ? run(b, plans, SIZES) : NULL;
    for (int k = 0; k < SIZES; k++) {
        bench_scene_free(&scenes[k]);
        b->found.picture[k] = r ? r + k : NULL;
    }
    if (r)
        bench_report_stages(b->found.picture, SIZES);
    return r;
}

static bool limit(bench *b)
{
    static const uint32_t masks[] = {0, GAIT_CPU_BASE, GAIT_CPU_BASE | GAIT_CPU_SSE4,
                                     GAIT_CPU_BASE | GAIT_CPU_AVX2, ~0u};
    printf(
        "\ntexture-only limit, %d particles x %d limbs x %d samples, CPU ms: two look-ups, ancestor kept\n",
        LIMIT_PARTICLES, LIMIT_LIMBS, LIMIT_SAMPLES);
    for (size_t k = 0; k < sizeof masks / sizeof *masks; k++) {
        if (masks[k] != ~0u && (masks[k] & ~gait_cpu_features()))
            continue;
        bench_limit kernel;
        if (!bench_limit_make(&kernel, masks[k], b->why))
            return false;
        double const both_ms = bench_limit_ms(&kernel, kernel.both),
                     kept_ms = bench_limit_ms(&kernel, kernel.kept);
        bench_limit_free(&kernel);
        const char *const isa = gait_cpu_name(masks[k]);
        bench_report_add("limit_both", isa, both_ms);
        bench_report_add("limit_kept", isa, kept_ms);
        printf("%-7s %8.2f %8.2f\n", isa, both_ms, kept_ms);
    }
    return true;
}

static bool measure(const settings *set, const gait_model *model, message *why)
{
    static bench b;
    b = (bench){.set = set, .model = model, .why = why};
    bool const ok = bench_scene_make(&b.scene, model, 640, 480, FRAMES, why) && modes(&b) &&
                    instruction_sets(&b) && small_computers(&b) && sweep(&b) && pictures(&b) && limit(&b);
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
    if (!file_read(set->model, "model", FILE_MOST, &blob, why))
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
    settings set = {.model = "python/gait/data/walk.gait",
                    .particles = "1000,3000,10000,30000,100000",
                    .threads = "1,2",
                    .steps = 80};
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
        printf("usage: step [options]\n\nTime the tracker on a drawn person.\n\n");
        options_help(table, count);
        return 0;
    }
    bool const sound = parsed != OPTION_BAD && check(&set, &why);
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ); /* lines as they come, also into a file or over ssh */
    if (!sound || !bench_model(&set, &why)) {
        fprintf(stderr, "step: %s\n", why.text);
        return sound ? 1 : 2;
    }
    return 0;
}
