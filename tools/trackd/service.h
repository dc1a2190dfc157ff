/* service.h - the tracker as a service: messages in, messages out, independent of the transport. */
#ifndef TRACKD_SERVICE_H
#define TRACKD_SERVICE_H
#include "cameras.h"
#include "convert.h"
#include "frame_hold.h"
#include "further.h"
#include "gaitmsg_command_t.h"
#include "gaitmsg_particles_t.h"
#include "gaitmsg_status_t.h"
#include "keypoints.h"
#include "lcm_link.h"
#include "lift_service.h"
#include "nearest.h"
#include "pose_path.h"
#include "strides.h"
#include "timing.h"
#include "tracking.h"

/* Since the program started or the last RESET. */
typedef struct service_counts {
    int64_t frames, dropped, rejected;
    histogram step, latency; /* microseconds */
} service_counts;

enum {
    SERVICE_PAST = 65, /* more than the longest lag */
    SERVICE_SENT = 64  /* own statuses that are still recognised */
};

typedef struct past_frame { /* a frame that was tracked */
    uint64_t step;          /* of the tracker */
    int64_t frame, number, receive_utime;
    int32_t step_us;
} past_frame;

/* Why incoming frames are not tracked. */
enum {
    SERVICE_IDLE_NOT,
    SERVICE_IDLE_CAMERA,
    SERVICE_IDLE_START,
    SERVICE_IDLE_SCENE,
    SERVICE_IDLE_SEARCHING
};

/* What the services of all people share. */
typedef struct service_shared {
    sink *out; /* where messages go */
    int threads;
    size_t pool_bytes;     /* of the threads */
    double max_gap;        /* longest pause that is bridged by prediction, seconds */
    int stream;            /* number of the first camera, [0, 30] */
    camera_slot slot;      /* the first camera; trackers are there when all cameras are known */
    pose_path *path;       /* poses of the first camera, which moves; NULL: it stands still */
    further *further;      /* further cameras; NULL: there is one */
    int32_t max_pixels;    /* of all cameras that are announced, together */
    message refused;       /* why the camera that was announced last cannot be used */
    bool quiet;            /* the trackers are not reported when they are made */
    bool compared;         /* the background has been compared with a frame */
    frame_hold hold;       /* the frame that waits for keypoints, a pose or further cameras */
    int64_t arrived;       /* frames since the program started */
    int64_t nearest_utime; /* of the frame whose people track.nearest of the first service shows; -1: none */
    lift_service *lift;    /* the second service; NULL: not requested */
} service_shared;

/* Of several people each has a service: a list, of which the first one receives what concerns all. */
typedef struct service {
    service_shared *shared;
    tracking track;
    struct service *first, *next; /* first: NULL for itself */
    int person;                   /* whose channels these are; 0: people are not distinguished */
    gait_state last;              /* last estimate */
    gait_track_status last_status;
    keypoint_cue *cue; /* a detector's keypoints for the tracker; NULL: not requested */
    bool has_init;
    init_state init; /* of --init FILE */
    start_trigger start;
    bool seek;      /* start automatically, and again when the person is lost */
    int64_t fitted; /* capture time of the last frame at which the automatic start was solved */
    int8_t state;   /* GAITMSG_STATUS_T_* */
    bool news;      /* the state has changed since the last status */
    int64_t command_id;
    int64_t sent[SERVICE_SENT]; /* times of the last statuses, a ring by their number */
    uint32_t statuses;
    service_counts counts;
    int64_t tracked;         /* frames since the program started, unaffected by RESET */
    int64_t dropped_before;  /* value of counts.dropped at START */
    int64_t last_frame;      /* highest number of a frame that arrived; -1: none */
    int64_t last_arrived;    /* capture time of the last frame that arrived */
    bool missed;             /* that frame was not tracked and is counted as dropped */
    int64_t last_utime;      /* capture time of the last tracked frame, or of the start */
    int64_t steps;           /* frames tracked since START */
    int64_t stepped;         /* monotonic time of the last tracked frame, or of the start */
    budget budget;           /* limit 0 for a log, which is played without dropping frames */
    int32_t wanted;          /* particles requested last; 0 before there is a tracker */
    int idle;                /* SERVICE_IDLE_* that was reported last */
    message text, complaint; /* text of the status; last complaint on stderr */
    estimate_message estimate;
    past_frame past[SERVICE_PAST];
    stride_meter meter;
    uint8_t *particles; /* encoded particles_t; NULL: not sent */
    size_t particles_bytes;
    gait_state *hypothesis; /* [hypotheses] */
    int32_t hypotheses;     /* capacity */
    gaitmsg_particles_t cloud;
} service;

/* `shared` is set and `track` open.  With `particles`, also takes the memory for GAIT_PARTICLES. */
bool service_open(service *s, const init_state *init, bool particles, message *why);
void service_close(service *s);
/* After all services have been closed. */
void service_shared_close(service_shared *c);

/* Make a service for one more person, before it is opened and the camera is set. */
void service_share(service *s, service *first, int person, keypoint_cue *cue);
/* The following calls are of the first service, and concern everyone. */
/* Make everyone's tracker for the camera in the slot, if all further ones are known, too.  false: there are none, and the
 * camera is not known. */
bool service_make_trackers(service *s, message *why);
/* Everyone's background is that of the first service. */
void service_share_background(service *s);
/* A camera was announced, the first one or, unless NULL, a further one; see camera_announced().  With a path it is a pose,
 * if the lens is that of the camera in use. */
void service_camera(service *s, further_camera *c, const gaitmsg_camera_t *msg, int64_t arrival);
/* Pixels that --max-pixels leaves to the camera of this slot. */
int64_t service_pixels_left(const service *s, const camera_slot *slot);
void service_background(service *s, const image_view *v);
void service_further_background(service *s, further_camera *c, const image_view *v);
/* To one service. */
void service_command(service *s, const gaitmsg_command_t *msg);
/* Whether a frame should wait for everyone's keypoints, for the pose of its camera or for frames of further cameras. */
bool service_waits(const service *s, int64_t utime);
/* A frame that arrived at `arrival_utime`; it is dropped if it is not the newest one. */
void service_frame(service *s, const image_view *v, bool newest, int64_t arrival_utime);
/* Report a fault of the input in the status and, unless it is the last one repeated, on stderr. */
void service_complain(service *s, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Change the state to GAITMSG_STATUS_T_*; text NULL: keep the text of the status. */
void service_set_state(service *s, int8_t state, const char *text);
/* Pixels of a frame or background in the format of the tracker. */
bool service_pixels(service *s, const image_view *v, gait_image *out, message *why);
/* Explain why no frame has been tracked. */
void service_lack(const service *s, message *why);
/* GAIT_ESTIMATE, GAIT_ESTIMATE_LAG, GAIT_STRIDE and GAIT_PARTICLES of a frame that was tracked. */
void service_send_estimate(service *s, const image_view *v, const gait_estimate *e, int64_t received,
                           int64_t step_us);
/* Continue tracking the person of a restored tracker, whose last tracked frame is this one, after so many steps. */
void service_resume(service *s, int64_t utime, int64_t frame, int64_t steps);
void service_send_status(service *s);
/* A GAIT_STATUS message sent at `utime` was received.  If this service did not send it, another daemon did; report
 * that. */
void service_status(service *s, int64_t utime);
uint64_t service_digest(const service *s); /* 0 before the camera is known */
#endif
