#include "bench_verdict.h"
#include "bench_limit.h"
#include "likelihood/likelihood.h"
#include "model/model.h"

#include <stdio.h>
#include <stdlib.h>

/* PARSEC bodytrack with one camera and 10,000 particles x 1 layer on one core of such a machine: quoted, not
 * measured here.  Its samples are points on edges, which it looks up in an edge map, and points inside limbs, in the
 * foreground. */
static const double PARSEC_MS[2] = {43, 58};
enum { PARSEC_SAMPLES = 481 };
/* The texture-only limit on that machine, the largest figure quoted.  The limit measured here, in turns with what is
 * judged, shows how fast this machine is at the moment. */
static const double LIMIT_MS = 17;

void verdict_size(verdict *v, const bench_result *r)
{
    double const cost = r->particle_ratio;
    if (r->particles < 1000 || r->particles > 100000)
        return;
    v->least = v->least == 0.0 || cost < v->least ? cost : v->least;
    v->most = cost > v->most ? cost : v->most;
}

/* Points on the surface and the edges of a body; hidden ones are not read. */
static int32_t points(const gait_model *m)
{
    enum { EDGE_POINTS = 16 }; /* of a limb: edges_count */
    return m->limbs * (LIKE_HALF + EDGE_POINTS);
}

/* One line; `more`: larger is better. */
static void line(const char *what, double wanted, double reached, bool more, const char *unit)
{
    bool const ok = more ? reached >= wanted : reached <= wanted;
    printf("%-62s %s %8.2f %10.2f %-8s %s\n", what, more ? ">=" : "<=", wanted, reached, unit,
           ok ? "reached" : "MISSED");
}

static double fps(const bench_result *r)
{
    return 1e3 / r->median_ms;
}

/* As measured, and scaled to the quoted limit with this machine's ratio of a step to the limit. */
static void rate_lines(const char *what, double wanted, const bench_result *r)
{
    line(what, wanted, fps(r), true, "fps");
    line("    scaled to a limit of 17 ms (times limit here / 17 ms)", wanted,
         1e3 / (r->limit_ratio * LIMIT_MS), true, "fps");
}

/* A board has NEON, which is `base` there, or SSE4.1: the rates that such instructions leave a core a sixth as fast. */
static void slow_lines(const verdict *v)
{
    char what[64];
    line("    on a core a sixth as fast", 30, fps(v->usual.one) / 6, true, "fps");
    for (int few = 0; few < 2; few++)
        for (int k = 0; k < v->slows; k++) {
            const bench_result *const r = v->slow[few][k];
            snprintf(what, sizeof what, "        with %s%s", r->isa, few ? ", 500 particles" : "");
            line(what, 30, fps(r) / 6, true, "fps");
        }
}

/* The gain of a second thread, compared with running two independent trackers at once: on virtual machines two
 * "cores" may be hardware threads of one, which share its units and caches. */
static void thread_lines(const by_threads *many)
{
    line("two threads against one, 10,000 particles", 1.8, 1 / many->two->ratio, true, "times");
    line("    against a tracker on each core at the same time", 0.9,
         0.5 * many->twins->ratio / many->two->ratio, true, "times");
    printf("    those two do %.2f times the steps of one alone: these cores cannot do more\n",
           2 / many->twins->ratio);
}

static double tail(const bench_result *r)
{
    return r->p99_ms / r->median_ms;
}

/* The slowest steps, and the slowest runs of the limit in turns with them: its work never changes, so its share is the
 * machine's.  Then the slowest frame by the least time of each frame over the rounds, which is the work's share. */
static void latency_line(const char *what, const bench_result *r, const bench_result *twins)
{
    bool const alone = r->plan.threads == 1;
    line(what, 1.3, tail(r), false, "times");
    if (alone)
        line("        by CPU time", 1.3, r->cpu_p99_ms / r->cpu_ms, false, "times");
    printf("        the texture-only limit's, whose work never changes: %.2f times\n",
           r->limit_p99_ms / r->limit_ms);
    line("        slowest frame, least over the rounds, to the median", 1.3, r->slowest, false, "times");
    if (twins)
        line("        against two trackers with nothing in common, a core each", 1.0, tail(r) / tail(twins),
             false, "times");
    if (alone)
        line("        slowest frame, by CPU time", 1.3, r->cpu_slowest, false, "times");
}

static void latency_lines(const verdict *v)
{
    latency_line("p99 of a step against its median, default mode, 10,000", v->many[0].one, NULL);
    latency_line("    two threads", v->many[0].two, v->many[0].twins);
    latency_line("    paper mode, 10,000", v->many[1].one, NULL);
    latency_line("    paper mode, two threads", v->many[1].two, NULL);
    latency_line("    default number of particles", v->usual.one, NULL);
    latency_line("    default number of particles, two threads", v->usual.two, NULL);
    latency_line("    a search", v->search.one, NULL);
    latency_line("    a search, two threads", v->search.two, NULL);
}

static void speed_lines(const verdict *v)
{
    const by_threads *const many = &v->many[0], *const paper = &v->many[1];
    rate_lines("default mode, 10,000 particles, one core", 30, many->one);
    rate_lines("default mode, 10,000 particles, two cores", 55, many->two);
    rate_lines("paper mode, 10,000 particles, one core", 30, paper->one);
    rate_lines("paper mode, 10,000 particles, two cores", 55, paper->two);
    rate_lines("default number of particles, one core", 200, v->usual.one);
    slow_lines(v);
    line("    memory of the tracker", 2.5, (double)v->usual.one->bytes / 1e6, false, "MB");
    rate_lines("    while it searches for the phase, with twice as many", 30, v->search.one);
    thread_lines(many);
    latency_lines(v);
    line("by CPU time of the calling thread: default mode, one core", 30, 1e3 / many->one->cpu_ms, true,
         "fps");
    line("    paper mode", 30, 1e3 / paper->one->cpu_ms, true, "fps");
    line("    default number of particles", 200, 1e3 / v->usual.one->cpu_ms, true, "fps");
}

static void kernel_lines(const verdict *v)
{
    const bench_result *const best = v->isa[v->isas - 1];
    bench_samples const visible = bench_stages_samples();
    double const limit_ns = 1e6 / ((double)LIMIT_PARTICLES * LIMIT_LIMBS * LIMIT_SAMPLES),
                 stage_ns = 1e6 * best->stage_ms[STAGE_LIKELIHOOD] / best->particles;
    for (int k = 0; k < v->isas; k++)
        if (v->isa[k]->plan.cpu_mask == (GAIT_CPU_BASE | GAIT_CPU_AVX2))
            line("AVX2 at most, 10,000 particles, one core, stages timed", 30, fps(v->isa[k]), true, "fps");
        else if (v->isa[k]->plan.cpu_mask == (GAIT_CPU_BASE | GAIT_CPU_SSE4)) {
            line("SSE4 at most, 10,000 particles, one core, stages timed, CPU", 33, v->isa[k]->cpu_ms, false,
                 "ms");
            line("    scaled to a limit of 17 ms (times 17 ms / limit here)", 33,
                 v->isa[k]->cpu_ms * LIMIT_MS / best->limit_ms, false, "ms");
        }
    line("likelihood stage, scalar against the best instruction set", 5,
         v->isa[0]->stage_ms[STAGE_LIKELIHOOD] / best->stage_ms[STAGE_LIKELIHOOD], true, "times");
    line("likelihood stage against the texture-only limit, two look-ups", 2, best->stage_ratio[0], false,
         "times");
    line("    the ancestor's samples kept, as the tracker keeps them", 2, best->stage_ratio[1], false,
         "times");
    printf("    a sample of the limit %.2f ns with two look-ups, %.2f with one; the stage %.2f ns for each "
           "point of\n"
           "    visible surface and edges, the silhouette and all else included\n",
           limit_ns * best->limit_ms, limit_ns * best->kept_ms, stage_ns / (visible.surface + visible.edges));
}

static void parsec_lines(const verdict *v, const gait_model *m)
{
    const bench_result *const best = v->isa[v->isas - 1], *const many = v->many[0].one;
    bench_samples const visible = bench_stages_samples();
    double const points_read = visible.surface + visible.edges, ours = points_read + visible.cells;
    double const stage = best->stage_ms[STAGE_LIKELIHOOD], step = many->cpu_ms;
    double const rate = 1e-3 * best->particles, ns = 1e6 * stage / best->particles;
    line("a step against PARSEC bodytrack's 43 ms (quoted)", 0.5, step / PARSEC_MS[0], false, "times");
    line("    as the limit's time here against its 17 ms there", 0.5,
         many->limit_ratio * LIMIT_MS / PARSEC_MS[0], false, "times");
    line("samples per likelihood, as PARSEC counts: with the foreground", PARSEC_SAMPLES, ours, true, "");
    printf("    of %d points %.0f of the surface and %.0f of the edges are visible and read; %.0f "
           "cells of the\n"
           "    silhouette, 64 of which are compared at once\n",
           (int)points(m), visible.surface, visible.edges, visible.cells);
    printf(
        "    million samples a second: %.0f in a step (%.0f without the silhouette's); PARSEC %.0f to %.0f\n",
        rate * ours / step, rate * points_read / step, rate * PARSEC_SAMPLES / PARSEC_MS[1],
        rate * PARSEC_SAMPLES / PARSEC_MS[0]);
    printf("    likelihood stage: %.0f ns per particle\n", ns);
    printf("    whole step: %.0f thousand particles per second and core\n", best->particles / step);
}

void verdict_print(const verdict *v, const gait_model *model)
{
    double load = 0.0;
    printf("\nthe texture-only limit takes %.1f ms here, in turns with the steps, and took at most %.0f ms "
           "on the\n"
           "machine for which the target rates were set: each rate is given as measured, and scaled to that "
           "machine\n",
           v->many[0].one->limit_ms, LIMIT_MS);
    printf("\n%-65s %8s %10s\n", "", "wanted", "this run");
    speed_lines(v);
    kernel_lines(v);
    parsec_lines(v, model);
    line("cost per particle by number of particles, most against least", 1.15, v->most / v->least, false,
         "times");
    line("cost per particle, 1920x1080 against 640x480", 1.1, v->picture[2]->particle_ratio, false, "times");
    line("memory of the tracker, 10,000 particles", 12, (double)v->many[0].one->bytes / 1e6, false, "MB");
    line("    with two threads", 12, (double)v->many[0].two->bytes / 1e6, false, "MB");
    printf("threads, numbers of particles and picture sizes took turns: their ratios are medians over "
           "single steps\n");
    if (getloadavg(&load, 1) == 1 && load > 2.5)
        printf("the machine was busy (load %.1f): only CPU times and their ratios mean something\n", load);
}
