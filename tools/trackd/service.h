/* service.h - the tracker as a service: messages in, messages out, independent of the transport. */
#ifndef TRACKD_SERVICE_H
#define TRACKD_SERVICE_H
#include "auto_start.h"
#include "convert.h"
#include "gaitmsg_command_t.h"
#include "gaitmsg_particles_t.h"
#include "gaitmsg_status_t.h"
#include "keypoints.h"
#include "lcm_link.h"
#include "lift_service.h"
#include "strides.h"
#include "timing.h"
#include "tracking.h"

/* ---- the tracker as a service: messages in, messages out, whatever carries them. */
/* Since the program's start or the last RESET. */
typedef struct service_counts {
    int64_t frames, dropped, rejected;
    histogram step, latency; /* microseconds */
} service_counts;

enum { SERVICE_PAST = 65 }; /* more than the longest lag */

typedef struct past_frame { /* what the source said of a frame that was tracked */
    uint64_t step;          /* of the tracker */
    int64_t frame, number, receive_utime;
    int32_t step_us;
} past_frame;

/* Why frames that come are not tracked. */
enum { SERVICE_IDLE_NOT, SERVICE_IDLE_CAMERA, SERVICE_IDLE_START, SERVICE_IDLE_SCENE, SERVICE_IDLE_LOOKING };

typedef struct service {
    tracking track;
    lift_service *lift; /* the second service; NULL: not asked for */
    keypoint_cue *cue;  /* joints of a detector for the tracker; NULL: not asked for */
    sink *out;          /* where messages go */
    int threads;
    int stream; /* number of the camera, [0, 30] */
    bool has_init;
    init_state init; /* of --init FILE */
    start_trigger start;
    bool compared;         /* the empty scene with a frame */
    bool seek;             /* start with whoever walks in, and again when lost */
    auto_start auto_start; /* looks for them */
    int8_t state;          /* GAITMSG_STATUS_T_* */
    bool news;             /* the state has changed since the last status */
    int64_t command_id;
    service_counts counts;
    int64_t came, tracked;   /* frames since the program's start, whatever RESET says */
    int64_t dropped_before;  /* value of counts.dropped at START */
    int64_t last_frame;      /* highest number of a frame that came; -1: none */
    int64_t last_came;       /* capture time of the last frame that came */
    bool missed;             /* that one was not tracked, and is counted as dropped */
    int64_t last_utime;      /* capture time of the last frame tracked, or of the start */
    int64_t steps;           /* frames tracked since START */
    budget budget;           /* limit 0 in a log, which is played without loss */
    int32_t wanted;          /* particles asked for last; 0 before there is a tracker */
    size_t pool_bytes;       /* of the threads */
    double max_gap;          /* longest pause that is bridged by prediction, seconds */
    int idle;                /* SERVICE_IDLE_*: said last of frames that nobody tracks */
    message text, complaint; /* what the status says; the last line on stderr */
    estimate_message estimate;
    past_frame past[SERVICE_PAST];
    stride_meter meter;
    uint8_t *particles; /* encoded particles_t; NULL: not sent */
    size_t particles_bytes;
    gait_state *hypothesis; /* [hypotheses] */
    int32_t hypotheses;     /* the most there can be */
    gaitmsg_particles_t cloud;
} service;

/* `track` is open.  With `particles` the memory for GAIT_PARTICLES is taken now. */
bool service_open(service *s, sink *out, int stream, int threads, const init_state *init, bool particles,
                  message *why);
void service_close(service *s);

bool service_set_camera(service *s, const gait_camera *camera, message *why);
void service_camera(service *s, const gaitmsg_camera_t *msg);
void service_background(service *s, const image_view *v);
void service_command(service *s, const gaitmsg_command_t *msg);
/* One frame that arrived at `arrival_utime`; not the `newest`: another waits behind it, this one is dropped. */
void service_frame(service *s, const image_view *v, bool newest, int64_t arrival_utime);
/* Say in the status, and once on stderr, what is wrong with the input; reject: and count it. */
void service_complain(service *s, const message *why);
void service_reject(service *s, const message *why);
/* Go to a state, GAITMSG_STATUS_T_*; text NULL: the status goes on saying what it says. */
void service_set_state(service *s, int8_t state, const char *text);
/* Pixels of a frame or plate as the tracker takes them. */
bool service_pixels(service *s, const image_view *v, gait_image *out, message *why);
/* Why no frame that came was tracked. */
void service_lack(const service *s, message *why);
void service_send_status(service *s);
uint64_t service_digest(const service *s); /* 0 before the camera is known */
/* Wall clock, microseconds since the Unix epoch. */
int64_t service_now(void);
/* The same of a clock that nobody sets, from any beginning. */
int64_t service_ticks(void);

/* ---- what the service publishes. */
/* GAIT_ESTIMATE, and GAIT_PARTICLES when asked for; `received` is when the frame had arrived. */
void service_send_estimate(service *s, const image_view *v, const gait_estimate *e, int64_t received,
                           int64_t step_us);
#endif
