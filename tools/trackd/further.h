/* further.h - cameras besides the first one: keeps their frames until the first camera's frame of the same time
 * arrives. */
#ifndef TRACKD_FURTHER_H
#define TRACKD_FURTHER_H
#include "cameras.h"
#include "image_view.h"
#include "pose_path.h"

enum {
    FURTHER_MOST = GAIT_MAX_CAMERAS - 1,
    FURTHER_PAST = 4,      /* frames kept of each camera */
    FURTHER_APART = 100000 /* microseconds; frames further apart are never paired */
};

typedef struct further_camera {
    int stream; /* its number */
    camera_slot slot;
    pose_path *path;       /* poses of a camera that moves; NULL: it stands still */
    gait_camera_pose pose; /* of the frame in use */
    uint8_t *pixels;       /* of the background, then of the frames */
    size_t bytes;          /* of pixels */
    gait_image background; /* data NULL: none */
    gait_image frame[FURTHER_PAST];
    int64_t utime[FURTHER_PAST]; /* of the frames, a ring by their number; -1: none */
    int64_t frames;              /* that arrived */
    int64_t used, missing;       /* frames of the first camera with and without one of this camera */
} further_camera;

typedef struct further {
    int count;
    further_camera camera[FURTHER_MOST];
    int64_t before; /* capture time of the first camera's frame before; -1: none */
} further;

/* Numbers of cameras, separated by commas; false unless they are 1 to FURTHER_MOST, none twice and none `first`. */
bool further_open(further *f, const char *streams, int first, message *why);
void further_close(further *f);
/* The camera with this number. */
further_camera *further_find(further *f, int stream);
/* The first camera that has not been announced; NULL: all have been. */
const further_camera *further_unknown(const further *f);
/* Take memory for pictures of the camera in the slot, after freeing those of another; no tracker may use them.  If there is
 * not enough, the camera is not known. */
bool further_allocate(further_camera *c, message *why);
/* Copy a background or a frame, which must have the camera's size. */
bool further_take_background(further_camera *c, const image_view *v, message *why);
bool further_take_frame(further_camera *c, const image_view *v, message *why);
/* Whether a frame of the first camera should wait, because another camera's frame of that time, or its pose, may still
 * arrive. */
bool further_waits(const further *f, int64_t utime);
/* Images nearest in time to a frame of the first camera, at most half an interval between its frames away, and the poses of
 * cameras that move; a camera without one has no image.  false: there is an image whose pose is not known. */
bool further_images(further *f, int64_t utime, gait_frame *frame, message *why);
#endif
