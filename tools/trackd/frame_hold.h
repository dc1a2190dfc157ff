/* frame_hold.h - one encoded frame that waits for what belongs to it: keypoints, or the pose of its camera. */
#ifndef TRACKD_FRAME_HOLD_H
#define TRACKD_FRAME_HOLD_H
#include "common.h"
#include "gait.h"

typedef struct frame_hold {
    uint8_t *frame;         /* an encoded image_t */
    size_t capacity, bytes; /* bytes 0: no frame waits */
    int64_t utime, arrival;
} frame_hold;

/* Allocate memory for a frame of this camera, in place of what was allocated before. */
bool frame_hold_allocate(frame_hold *h, const gait_camera *camera, message *why);
void frame_hold_close(frame_hold *h);
/* Hold a frame; false if it is too large. */
bool frame_hold_keep(frame_hold *h, int64_t utime, const void *image, size_t bytes, int64_t arrival);
#endif
