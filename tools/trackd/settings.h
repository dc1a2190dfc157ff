/* settings.h - what the command line and the configuration file of gait-trackd ask for. */
#ifndef TRACKD_SETTINGS_H
#define TRACKD_SETTINGS_H
#include "tracker_options.h"

typedef struct settings { /* 0 or empty: not given, unless said otherwise */
    char model[OPTION_TEXT], camera[OPTION_TEXT], background[OPTION_TEXT], init[OPTION_TEXT];
    char url[OPTION_TEXT], out[OPTION_TEXT], config[OPTION_TEXT], mode[OPTION_TEXT];
    int32_t stream, particles, adapt_particles, acquisition_particles, components, threads, tasks, lag,
        cpu_mask;
    uint64_t seed;
    float max_gap, budget_ms;
    char lift_model[OPTION_TEXT];
    float lift_stature, lift_sd;
    int32_t lift_lag; /* -1: not given */
    float tracks_sd;
    bool particles_channel, quiet, version, lift, tracks_term;
    tracker_values tracker;
} settings;

/* Command line over configuration file over defaults, checked against one another. */
option_result settings_read(settings *s, int argc, char **argv, message *why);
/* The manual, to stdout. */
void settings_help(void);
/* Configuration of the tracker, but for the camera. */
void settings_tracker(const settings *s, gait_tasks exec, gait_tracker_config *out);
#endif
