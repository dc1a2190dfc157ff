/* nearest.h - who is nearest in each pixel of a frame, from the bodies of everyone who is tracked. */
#ifndef TRACKD_NEAREST_H
#define TRACKD_NEAREST_H
#include "common.h"

enum { PEOPLE_MOST = 8 };

typedef struct nearest_body { /* of one person, in a frame */
    int number;               /* from 1 */
    gait_state state;
} nearest_body;

/* Draw `count` bodies into `picture`, the farthest first: the number of the nearest person in each pixel without lens
 * distortion, or 0.  picture and drawing: width x height of the camera.  The bodies are put in order. */
void nearest_draw(const gait_model *model, const gait_camera *camera, nearest_body *bodies, int count,
                  uint8_t *drawing, uint8_t *picture);
#endif
