/* auto_start.h - automatic start: find a person who walks into the empty scene and estimate their first state. */
#ifndef TRACKD_AUTO_START_H
#define TRACKD_AUTO_START_H
#include "gait.h"

#include <stdbool.h>

/* ---- the largest person-sized region in which an image differs from the background. */
enum { BLOB_CELLS = 320 * 320 }; /* the most cells into which an image is divided */

typedef struct blob_finder {
    int32_t step, width, height; /* pixels a cell; cells */
    int16_t change[BLOB_CELLS];  /* largest change of a channel, grey levels */
    int16_t smooth[BLOB_CELLS];
    uint8_t mask[BLOB_CELLS]; /* 1: differs, 2: also belongs to a region already examined */
    int32_t queue[BLOB_CELLS];
} blob_finder;

typedef struct blob {        /* pixels */
    double foot[2], head[2]; /* lowest and highest point on the middle line */
    int32_t area;            /* cells */
} blob;

/* Whether half of an image differs from the background, so that it shows another scene.  Both have the same size. */
bool blob_another_scene(blob_finder *f, const gait_image *image, const gait_image *plate);

/* Both images have the same size.  False: no person stands in full view. */
bool blob_find(blob_finder *f, const gait_image *image, const gait_image *plate, blob *out);

/* ---- the first state, from a second of person detections; as in python/gait/track/auto_start.py. */
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
    detection past[AUTO_START_DETECTIONS]; /* oldest first */
} auto_start;

void auto_start_reset(auto_start *s);

/* Examine a frame of the camera's size.  True: a person has walked in full view for a second; `mean` and `sd`, which hold the
 * model's prior, then become their state at the latest detection. */
bool auto_start_add(auto_start *s, const gait_image *frame, const gait_image *plate,
                    const gait_camera *camera, const gait_model *model, int64_t utime, gait_state *mean,
                    gait_state *sd);
#endif
