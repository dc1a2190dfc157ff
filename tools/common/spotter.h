/* spotter.h - somebody walks into the empty scene: from a second of blobs to a first state; as
 * gait/track/autostart.py. */
#ifndef TOOLS_SPOTTER_H
#define TOOLS_SPOTTER_H
#include "blob_finder.h"

enum { SPOTTER_SIGHTINGS = 64 };

typedef struct sighting {
    int64_t utime;
    double away[2];    /* horizontal direction from the lens */
    double distance;   /* horizontal, from the lens to where the foot's ray meets the ground, metres */
    double head_slope; /* rise of the head's ray per metre of horizontal distance */
} sighting;

typedef struct spotter {
    blob_finder finder;
    int32_t count;
    sighting seen[SPOTTER_SIGHTINGS]; /* oldest first */
} spotter;

void spotter_forget(spotter *s);

/* Look at a frame of the camera's size.  True: somebody has walked in full view for a
 * second, and `mean` and `sd`, which hold the model's prior, become their state at the latest sighting. */
bool spotter_see(spotter *s, const gait_image *frame, const gait_image *plate, const gait_camera *camera,
                 const gait_model *model, int64_t utime, gait_state *mean, gait_state *sd);
#endif
