/* pose_path.h - where a camera that moves is at the time of a frame, from its announcements. */
#ifndef TRACKD_POSE_PATH_H
#define TRACKD_POSE_PATH_H
#include "common.h"
#include "gait.h"

enum {
    POSE_PATH_KEPT = 256,    /* poses; the oldest are forgotten */
    POSE_PATH_GAP = 500000,  /* microseconds: between poses further apart no pose is known */
    POSE_PATH_LATE = 100000, /* microseconds for which the last pose is valid if the next one is late */
    POSE_PATH_SET_BACK =
        2000000 /* microseconds: a pose that is so much earlier means that the clock was set back */
};

typedef struct timed_pose {
    int64_t utime;
    gait_camera_pose sent;
    double R[9], centre[3]; /* the same: world to camera; place of the lens, metres */
} timed_pose;

typedef struct pose_path {
    float turn_sd, place_sd; /* of every pose: radians, metres */
    int64_t count;           /* poses taken since the last one was forgotten */
    timed_pose pose[POSE_PATH_KEPT];
    int64_t refused, unknown; /* poses out of order; frames without a pose */
} pose_path;

typedef enum pose_answer {
    POSE_KNOWN,
    POSE_LATER,  /* after the last pose: wait */
    POSE_UNKNOWN /* before the first pose, or in a gap or a jump */
} pose_answer;

/* Take a pose.  false: it is not after the last one; one that is far before it begins a path anew. */
bool pose_path_add(pose_path *p, int64_t utime, const gait_camera *camera, message *why);
/* Pose at a time, interpolated between its neighbours: shortest rotation, straight line. */
pose_answer pose_path_at(const pose_path *p, int64_t utime, gait_camera_pose *out, message *why);
/* The same for a frame that does not wait: the last pose is valid for POSE_PATH_LATE. */
bool pose_path_now(pose_path *p, int64_t utime, gait_camera_pose *out, message *why);
#endif
