/* tracking.h - one tracker with its model and camera, and the frame at which it starts. */
#ifndef TRACKD_TRACKING_H
#define TRACKD_TRACKING_H
#include "common.h"
#include "gait_start.h"
#include "image_view.h"
#include "input_files.h"

/* ---- start trigger: a commanded start waits until the stream reaches its frame. */
typedef struct start_trigger {
    bool armed;
    gait_state mean, sd;
    int64_t frame;  /* start at the frame of this number; -1: by time */
    int64_t utime;  /* start at this capture time; 0: at the next frame, */
    int64_t before; /* which is not that of this time: it waits since before the command; -1: none does */
    int64_t last_frame, last_utime; /* of the frame before; -1: none yet */
    int64_t received;               /* frames, for sources that do not number them */
} start_trigger;

typedef enum start_trigger_answer {
    START_TRIGGER_WAIT,
    START_TRIGGER_START,
    START_TRIGGER_MISSED
} start_trigger_answer;

void start_trigger_by_file(start_trigger *a, const init_state *init);
/* `before`: capture time of the frame that waits, see above. */
void start_trigger_by_time(start_trigger *a, const gait_state *mean, const gait_state *sd, int64_t utime,
                           int64_t before);
/* Whether the stream has reached the start; `utime` is then the capture time of the start.  START_TRIGGER_MISSED: the stream
 * began more than `max_gap` seconds too late. */
start_trigger_answer start_trigger_reached(start_trigger *a, const image_view *frame, double max_gap,
                                           int64_t *utime, message *why);

/* ---- one model, one camera, one tracker, in one block of memory that is allocated once for a camera.  Trackers of
 * several people share the model and all pictures, which the first one has. */
typedef struct tracking {
    struct tracking *first; /* whose model and pictures these are; NULL: its own */
    bool several;           /* there are others that share them: pictures of who is nearest are needed */
    model_file file;
    const gait_model *model;
    gait_model_info info;
    gait_state prior_mean, prior_sd;
    gait_tracker_config config;
    gait_tracker *tracker;               /* NULL until the camera is known */
    gait_start *start;                   /* the automatic start; NULL until then */
    unsigned char *block;                /* memory of tracker and start, and of the pictures that follow */
    uint8_t *plate, *pixels;             /* background; decoded JPEG frame */
    uint8_t *nearest, *drawing;          /* with `several`, a byte per pixel: see nearest.h; else NULL */
    gait_image background;               /* data NULL: none */
    gait_image decoded;                  /* JPEG frame in `pixels`; data NULL: none */
    size_t model_bytes;                  /* blob and model */
    size_t tracker_bytes, picture_bytes; /* tracker and start; pixels */
    size_t memory_bytes;                 /* all of these */
} tracking;

/* Load the model.  `config` is complete except for camera[0]. */
bool tracking_open(tracking *t, const char *model_path, const gait_tracker_config *config, message *why);
/* One more tracker with the model, the configuration and the pictures of `first`. */
void tracking_share(tracking *t, tracking *first);
void tracking_close(tracking *t);
/* Allocate the block and create the tracker, in place of that of another camera, if there is one; first that of
 * `first`. */
bool tracking_set_camera(tracking *t, const gait_camera *camera, message *why);
/* Free the tracker and its pictures. */
void tracking_drop_camera(tracking *t);
/* Copy the background, unless it is already in use.  It must have the camera's size. */
bool tracking_set_background(tracking *t, const gait_image *plate, message *why);
/* Use the background of `first`. */
void tracking_share_background(tracking *t);
/* Start from a state; an invalid one is rejected and changes nothing. */
bool tracking_start(tracking *t, const gait_state *mean, const gait_state *sd, int64_t utime, message *why);
#endif
