#include "bench_report.h"
#include "trackd/options.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { MAX_RESULTS = 128, MAX_OTHERS = 16 };

static bench_result results[MAX_RESULTS];
static const char *section_of[MAX_RESULTS], *section;
static int count;
static struct {
    const char *what, *isa;
    double ms;
} others[MAX_OTHERS];
static int other_count;

const bench_result *bench_report_measure(const gait_model *model, const bench_plan *plans, int32_t n,
                                         message *why)
{
    bench_result *const first = results + count;
    if (count + n > MAX_RESULTS) {
        message_set(why, "more than %d measurements", MAX_RESULTS);
        return NULL;
    }
    for (int32_t k = 0; k < n; k++) {
        first[k] = (bench_result){.plan = plans[k]};
        section_of[count + k] = section;
    }
    if (!bench_measure(model, first, n, why))
        return NULL;
    count += n;
    return first;
}

void bench_report_add(const char *what, const char *isa, double ms)
{
    if (other_count < MAX_OTHERS) {
        others[other_count].what = what;
        others[other_count].isa = isa;
        others[other_count++].ms = ms;
    }
}

static const char *mode_of(const bench_result *r)
{
    return r->plan.twins                     ? "twins"
           : r->plan.search                  ? "search"
           : r->plan.mode == GAIT_MODE_PAPER ? "paper"
                                             : "default";
}

void bench_report_head(const char *name, const char *title)
{
    section = name;
    printf(
        "\n%s\nmode    isa         size  particles threads memory_MB median_ms   p99_ms   cpu_ms      fps\n",
        title);
}

static void row(const bench_result *r)
{
    printf("%-7s %-7s %4dx%-4d %9d %7d %9.1f %9.2f %8.2f %8.2f %8.1f\n", mode_of(r), r->isa, (int)r->width,
           (int)r->height, (int)r->particles, (int)r->plan.threads, (double)r->bytes / 1e6, r->median_ms,
           r->p99_ms, r->cpu_ms, 1e3 / r->median_ms);
}

void bench_report_rows(const bench_result *r, int32_t n)
{
    for (int32_t k = 0; k < n; k++)
        row(&r[k]);
    fflush(stdout);
}

void bench_report_stages(const bench_result *const *runs, int n)
{
    printf("\nstages, CPU ns per particle (the step's fixed parts in ms)\n%-12s", "");
    for (int k = 0; k < n; k++)
        printf("%12s", runs[k]->isa);
    printf("\n%-12s", "particles");
    for (int k = 0; k < n; k++)
        printf("%12d", (int)runs[k]->particles);
    printf("\n");
    for (int stage = 0; stage < BENCH_STAGES; stage++) {
        printf("%s%-*s", bench_stage_is_part(stage) ? "  " : "", bench_stage_is_part(stage) ? 10 : 12,
               bench_stage_name[stage]);
        for (int k = 0; k < n; k++)
            if (stage == STAGE_FEATURES)
                printf("%9.3f ms", runs[k]->stage_ms[stage]);
            else
                printf("%12.1f", runs[k]->stage_ms[stage] * 1e6 / runs[k]->particles);
        printf("\n");
    }
    printf("edges: all that the kernels of the other terms leave of them, calls and the counting of points "
           "included\n");
}

bool bench_report_can_write(const char *path, message *why)
{
    const char *const slash = strrchr(path, '/');
    char folder[OPTION_TEXT] = ".";
    if (slash)
        snprintf(folder, sizeof folder, "%.*s", (int)(slash == path ? 1 : slash - path), path);
    bool const there = access(path, F_OK) == 0;
    return access(there ? path : folder, W_OK) == 0 ||
           message_set(why, "%.120s: cannot be written: %s", path, strerror(errno));
}

bool bench_report_csv(const char *path, message *why)
{
    FILE *const f = fopen(path, "w");
    if (!f)
        return message_set(why, "%.120s: cannot be written: %s", path, strerror(errno));
    fprintf(f,
            "section,what,isa,width,height,particles,threads,bytes,median_ms,p99_ms,cpu_ms,cpu_p99_ms,ratio,"
            "particle_ratio,slowest,cpu_slowest,limit_ratio,limit_ms,limit_p99_ms");
    for (int k = 0; k < BENCH_STAGES; k++)
        fprintf(f, ",%s_%s_ms", bench_stage_is_part(k) ? "likelihood" : "stage", bench_stage_name[k]);
    fprintf(f, "\n");
    for (int i = 0; i < count; i++) {
        const bench_result *const r = &results[i];
        fprintf(f, "%s,%s,%s,%d,%d,%d,%d,%zu,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,", section_of[i], mode_of(r),
                r->isa, (int)r->width, (int)r->height, (int)r->particles, (int)r->plan.threads, r->bytes,
                r->median_ms, r->p99_ms, r->cpu_ms, r->cpu_p99_ms, r->ratio, r->particle_ratio);
        r->slowest > 0.0 ? fprintf(f, "%.4f,%.4f,", r->slowest, r->cpu_slowest) : fprintf(f, ",,");
        r->plan.limit ? fprintf(f, "%.4f,%.4f,%.4f", r->limit_ratio, r->limit_ms, r->limit_p99_ms)
                      : fprintf(f, ",,");
        for (int k = 0; k < BENCH_STAGES; k++)
            r->plan.stages ? fprintf(f, ",%.4f", r->stage_ms[k]) : fprintf(f, ",");
        fprintf(f, "\n");
    }
    for (int i = 0; i < other_count; i++) {
        fprintf(f, "limit,%s,%s,,,,1,,,,%.4f,,,,,,,,", others[i].what, others[i].isa, others[i].ms);
        for (int k = 0; k < BENCH_STAGES; k++)
            fprintf(f, ",");
        fprintf(f, "\n");
    }
    return fclose(f) == 0 || message_set(why, "%.120s: cannot be written: %s", path, strerror(errno));
}
