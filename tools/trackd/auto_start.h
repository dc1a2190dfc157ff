/* auto_start.h - somebody walks into the empty scene: from a second of blobs to a first state; as
 * gait/track/autostart.py. */
#ifndef TRACKD_AUTO_START_H
#define TRACKD_AUTO_START_H
#include "blob_finder.h"

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
bool auto_start_add(auto_start *s, const gait_image *frame, const gait_image *plate, const gait_camera *camera,
                 const gait_model *model, int64_t utime, gait_state *mean, gait_state *sd);
#endif
