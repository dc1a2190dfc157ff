/* auto_start.h - automatic start: find a person who walks into the empty scene and estimate their first state. */
#ifndef TRACKD_AUTO_START_H
#define TRACKD_AUTO_START_H
#include "gait.h"

#include <stdbool.h>

/* ---- the largest person-sized patch in which a picture differs from the empty scene. */
enum { BLOB_CELLS = 320 * 320 }; /* a picture is looked at in at most so many cells */

typedef struct blob_finder {
    int32_t step, width, height; /* pixels a cell; cells */
    int16_t change[BLOB_CELLS];  /* largest change of a channel, grey levels */
    int16_t smooth[BLOB_CELLS];
    uint8_t mask[BLOB_CELLS]; /* 1: differs, 2: also belongs to a patch that was looked at */
    int32_t queue[BLOB_CELLS];
} blob_finder;

typedef struct blob {        /* pixels */
    double foot[2], head[2]; /* lowest and highest point on the middle line */
    int32_t area;            /* cells */
} blob;

/* Does half of a picture differ from the empty scene, so that it shows another one?  Both have the same size. */
bool blob_another_scene(blob_finder *f, const gait_image *image, const gait_image *plate);

/* Both pictures have the same size.  False: nobody stands in full view. */
bool blob_find(blob_finder *f, const gait_image *image, const gait_image *plate, blob *out);

/* ---- somebody walks into the empty scene: from a second of blobs to a first state; as
 * gait/track/autostart.py. */
enum { AUTO_START_DETECTIONS = 64 };

typedef struct detection {
    int64_t utime;
    double away[2];    /* horizontal direction from the lens */
    double distance;   /* horizontal, from the lens to where the foot's ray meets the ground, metres */
    double head_slope; /* rise of the head's ray per metre of horizontal distance */
} detection;

typedef struct auto_start {
    blob_finder finder;
    int32_t count;
    detection seen[AUTO_START_DETECTIONS]; /* oldest first */
} auto_start;

void auto_start_reset(auto_start *s);

/* Look at a frame of the camera's size.  True: somebody has walked in full view for a
 * second, and `mean` and `sd`, which hold the model's prior, become their state at the latest detection. */
bool auto_start_add(auto_start *s, const gait_image *frame, const gait_image *plate,
                    const gait_camera *camera, const gait_model *model, int64_t utime, gait_state *mean,
                    gait_state *sd);
#endif
