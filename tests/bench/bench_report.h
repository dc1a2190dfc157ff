/* bench_report.h - measurements as tables to read and as rows of a CSV file. */
#ifndef BENCH_REPORT_H
#define BENCH_REPORT_H
#include "bench_measure.h"

/* Results of trackers that take turns, kept until the program ends; NULL, with the reason in `why`, on failure. */
const bench_result *bench_report_measure(const gait_model *model, const bench_plan *plans, int32_t count,
                                         message *why);
/* CPU milliseconds of something other than a tracker. */
void bench_report_add(const char *what, const char *isa, double ms);

/* Begin a table; rows of the CSV until the next have the section's name. */
void bench_report_head(const char *section, const char *title);
void bench_report_rows(const bench_result *r, int32_t count);
/* Stages of several runs side by side, nanoseconds per particle; for features milliseconds per step. */
void bench_report_stages(const bench_result *const *runs, int count);
/* Whether the table of figures could be written there, without creating it. */
bool bench_report_can_write(const char *path, message *why);
bool bench_report_csv(const char *path, message *why);
#endif
