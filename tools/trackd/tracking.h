/* tracking.h - one model, one camera, one tracker in one block of memory that is taken once. */
#ifndef TRACKD_TRACKING_H
#define TRACKD_TRACKING_H
#include "model_file.h"

typedef struct tracking {
    model_file file;
    const gait_model *model;
    gait_model_info info;
    gait_state prior_mean, prior_sd;
    gait_tracker_config config;
    gait_tracker *tracker; /* NULL until the camera is known */
    unsigned char *block;  /* tracker, background plate, pixels of a decoded JPEG frame */
    uint8_t *plate, *pixels;
    gait_image background; /* data NULL: none */
    size_t model_bytes;    /* blob and model */
    size_t tracker_bytes, picture_bytes;
    size_t memory_bytes; /* all of them and the pictures */
} tracking;

/* Load the model.  `config` is complete but for camera[0]. */
bool tracking_open(tracking *t, const char *model_path, const gait_tracker_config *config, message *why);
void tracking_close(tracking *t);
/* Take the block and make the tracker; only once. */
bool tracking_set_camera(tracking *t, const gait_camera *camera, message *why);
/* Copy the empty scene; one that is already there is left alone.  It must have the camera's size. */
bool tracking_set_background(tracking *t, const gait_image *plate, message *why);
/* Begin with a state; one that makes no sense is refused and changes nothing. */
bool tracking_start(tracking *t, const gait_state *mean, const gait_state *sd, int64_t utime, message *why);
#endif
