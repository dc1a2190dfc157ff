/* settings.h - the options of gait-trackd. */
#ifndef TRACKD_SETTINGS_H
#define TRACKD_SETTINGS_H
#include "gait.h"
#include "options.h"

typedef struct settings { /* 0 or empty: not given, unless noted */
    char model[OPTION_TEXT], camera[OPTION_TEXT], background[OPTION_TEXT], init[OPTION_TEXT];
    char url[OPTION_TEXT], out[OPTION_TEXT], config[OPTION_TEXT], mode[OPTION_TEXT];
    char snapshot[OPTION_TEXT], further_streams[OPTION_TEXT];
    int32_t stream, person, people, adapt_particles, threads, cpu_mask, max_pixels;
    float max_gap, budget_ms, snapshot_s;
    char lift_model[OPTION_TEXT];
    float lift_stature, lift_sd;
    int32_t lift_lag; /* -1: not given */
    float keypoints_sd;
    float pose_turn_sd, pose_place_sd;
    bool particles_channel, quiet, version, lift, keypoints_term, moving_camera;
    gait_tracker_config tracker; /* with the defaults of the mode; tasks 0: not given */
} settings;

/* Read the settings: the command line wins over the configuration file, which wins over the defaults.  Checked for
 * consistency. */
option_result settings_read(settings *s, int argc, char **argv, message *why);
/* Print the help to stdout. */
void settings_help(void);
/* Configuration of the tracker except the camera. */
void settings_tracker(const settings *s, gait_tasks exec, gait_tracker_config *out);
#endif
