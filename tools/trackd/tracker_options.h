/* tracker_options.h - the fields of gait_tracker_config that a user may set, by name. */
#ifndef TRACKD_TRACKER_OPTIONS_H
#define TRACKD_TRACKER_OPTIONS_H
#include "gait.h"
#include "options.h"

enum { TRACKER_OPTIONS = 30 };

/* Values set by the user; NaN: the mode's default stays. */
typedef struct tracker_values {
    float value[TRACKER_OPTIONS];
} tracker_values;

/* Fill table[0..TRACKER_OPTIONS) with options that write into `values`. */
void tracker_options_table(tracker_values *values, option *table);
/* Overwrite the fields of `config` that the user has set. */
void tracker_options_apply(const tracker_values *values, gait_tracker_config *config);
#endif
