/* cameras.h - cameras from files and messages; every fault is one line in `why`. */
#ifndef TRACKD_CAMERAS_H
#define TRACKD_CAMERAS_H
#include "gait.h"
#include "gaitmsg_camera_t.h"
#include "common.h"

/* The project's camera JSON; files of other formats reach the daemon through `gait capture`. */
bool camera_file_read(const char *path, gait_camera *out, message *why);
/* A camera that was announced over LCM. */
bool camera_from_message(const gaitmsg_camera_t *in, int64_t max_pixels, gait_camera *out, message *why);
/* Whether a camera that was sent or saved can be used; not if width times height is more than `max_pixels`. */
bool camera_check(const gait_camera *camera, int64_t max_pixels, message *why);
int64_t camera_pixels(const gait_camera *camera);
/* Whether the pose of a valid camera is plausible, by gait_camera_check().  `name`: its file or channel, for the error. */
bool camera_plausible(const gait_camera *camera, const char *name, message *why);
/* Equal up to rounding, which differs between files and messages, and readers may orthogonalise R. */
bool camera_same(const gait_camera *a, const gait_camera *b);

/* ---- the camera of a stream. */
enum { CAMERA_SILENT = 10000000 }; /* microseconds; cameras are announced every two seconds */

typedef struct camera_slot {
    bool known;
    bool fixed;       /* from --camera */
    bool provisional; /* from a snapshot, not yet announced */
    gait_camera camera;
    gait_camera other;   /* announced, but not the one in use */
    int64_t other_since; /* arrival of its first message since the one in use was announced; -1: none */
    int64_t refused;     /* monotonic time at which one was announced last that is not in use; 0: none was */
} camera_slot;

typedef enum { CAMERA_SAME, CAMERA_REFUSED, CAMERA_NEW } camera_answer;

/* Use `camera` from now on. */
void camera_use(camera_slot *slot, const gait_camera *camera);
/* A camera was announced in a message that arrived at `arrival`, microseconds of a clock that the sender cannot set.  One that
 * differs from the camera in use replaces it after only it has been announced for CAMERA_SILENT; at once if that is
 * provisional; never if that is fixed. */
camera_answer camera_announced(camera_slot *slot, const gait_camera *camera, int64_t arrival);
#endif
