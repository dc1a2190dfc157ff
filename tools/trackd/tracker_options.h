/* tracker_options.h - the settings of gait_tracker_config as options: names, ranges and help from its table in gait.h. */
#ifndef TRACKD_TRACKER_OPTIONS_H
#define TRACKD_TRACKER_OPTIONS_H
#include "gait.h"
#include "options.h"

/* Fill `table` with options that write into `config`, and return how many: every number with a range but `cameras`. */
int tracker_options_table(gait_tracker_config *config, option *table);
#endif
