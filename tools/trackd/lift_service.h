/* lift_service.h - the lifter as a service: 2-D keypoints of one camera in, 3-D joints out. */
#ifndef TRACKD_LIFT_SERVICE_H
#define TRACKD_LIFT_SERVICE_H
#include "gait_lift.h"
#include "gaitmsg_joint_t.h"
#include "timing.h"
#include "common.h"
#include "lcm_link.h"
#include "keypoints.h"

enum { LIFT_SERVICE_PAST = 65 }; /* more than the longest lag */

typedef struct lift_settings {
    float stature; /* metres; 0: mean of the training set */
    float sd;      /* pixels, of a keypoint with confidence 1; 0: the library's default */
    int32_t lag;   /* frames; -1: the library's default */
    uint32_t cpu_mask;
    int person; /* whose channel; 0: people are not distinguished */
} lift_settings;

typedef struct lift_past { /* one of the last frames */
    int64_t utime, frame, receive_utime;
} lift_past;

typedef struct lift_service {
    sink *out;
    int person;
    model_file file;
    gait_lift_config config;
    gait_lift_info info;
    gait_lift *lift; /* NULL until the camera is known */
    void *memory;    /* taken once */
    size_t memory_bytes;
    int64_t frames, lifted, rejected;
    int64_t last;       /* capture time of the last frame lifted; -1: none */
    bool reported_back; /* once on stderr: capture time went back */
    histogram step;     /* microseconds */
    keypoints_filter filter;
    double uv[2 * GAIT_MAX_MARKERS], sd[GAIT_MAX_MARKERS];
    gait_lift_frame estimate;
    gaitmsg_joint_t joint[GAIT_MAX_MARKERS];
    lift_past past[LIFT_SERVICE_PAST]; /* a ring by the number of frames */
} lift_service;

/* Read the segment prior of a blob and allocate all memory; s must be all zero. */
bool lift_service_open(lift_service *s, const char *model, const lift_settings *set, sink *out, message *why);
void lift_service_close(lift_service *s);
/* The first camera starts the service; another one restarts it. */
bool lift_service_camera(lift_service *s, const gait_camera *camera, message *why);
/* Push one frame's keypoints, received at `receive_utime`, and publish the result on GAIT_LIFT.  Keypoints from more
 * than a second before the last ones restart the stream: a clock was set, or one stamp was wrong. */
bool lift_service_keypoints(lift_service *s, keypoints_view *v, int64_t receive_utime, message *why);
#endif
