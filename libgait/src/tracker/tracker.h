/* tracker.h - the tracker's parts and the order of one step: resample, predict, weigh, estimate. */
#ifndef GAIT_TRACKER_TRACKER_H
#define GAIT_TRACKER_TRACKER_H
#include "filter/dynamics.h"
#include "filter/mirror.h"
#include "tracker/fixed_lag.h"
#include "likelihood/template.h"
#include "filter/pf.h"
#include "base/task.h"

/* What is known of left and right (modes.h). */
enum { HYPOTHESES_ONE, HYPOTHESES_ACQUISITION, HYPOTHESES_TWO };
typedef struct hypotheses_state {
    int32_t stage;
    int32_t known; /* left and right were settled before */
    int64_t since; /* when the stage began */
    double odds;   /* forked: log odds of the second side over the first, */
    double lead;   /* and by how much all terms have preferred it lately, nats */
} hypotheses_state;

typedef struct tracker_core { /* small mutable state; saved and hashed with the arrays that follow it */
    int64_t utime, start_utime;
    int64_t support_utime;      /* when the images last supported the estimate */
    int64_t rejuvenation_utime; /* when the particles last rejuvenated, or were of no one mode */
    uint64_t frame;             /* steps since start */
    int32_t started;
    int32_t current;        /* which of the generations kept holds the particles */
    uint32_t textured;      /* bit c: there are surface samples of camera c's previous frame */
    int32_t met;            /* the images have supported it since the start */
    int32_t part;           /* this frame supports but a part of it */
    float stature_sd_ratio; /* as in dynamics */
    float missed;           /* foreground that is usually left unexplained, nats */
    float front_back;       /* front_back_score() lately */
    double ess;
    hypotheses_state hypotheses;
    particle_state last; /* when the images last supported it */
    float phase, rate;   /* reported last: strides, strides per second */
    view_map map[GAIT_MAX_CAMERAS];
    int32_t fewer, less; /* particles than there is room for; wanted, than of the caller's config */
} tracker_core;

typedef struct camera_state {
    features features;
    view_planes plate;     /* background resampled to the region */
    gait_image background; /* borrowed; data NULL: none */
    bool plate_stale;
} camera_state;

typedef struct likelihood_scratch { /* one per task; its arrays hold the model's limbs and points */
    kin_body body;
    outline_block *outline;
    layers_block *lines;
    like_outline *sides;
    like_pose *pose;
    layers *layers;
    like_block terms;
    float (*points)[3][BLOCK];
} likelihood_scratch;

struct gait_tracker {
    const gait_model *model;
    gait_tracker_config cfg; /* particles: those in use now */
    int32_t most, room;      /* particles of the caller's config; that there is memory for */
    int32_t wanted;          /* particles that the caller wants when nothing is searched */
    state_layout rule;
    like_setup *like;
    /* Mutable state: one stretch of memory from core to state_end. */
    tracker_core *core;
    like_patch
        *texture; /* n x cameras x limbs: what particles saw, while weighing their ancestors; or NULL */
    pf filter;
    int16_t *template[2][GAIT_MAX_CAMERAS]; /* of each side while forked; otherwise the first */
    fixed_lag past;                         /* the particles of this step and those before */
    unsigned char *state_end;
    particle_set particles; /* this step's */
    /* Recomputed in every step. */
    camera_state camera[GAIT_MAX_CAMERAS];
    float *loglik;                    /* n: as much of loglik_raw as counts (loss.h, modes.h) */
    float *loglik_raw;                /* n */
    float *loglik_without_silhouette; /* n: loglik_raw without the silhouette */
    float *
        joint; /* P x 3 x n, metres: of the particles, or of those that fixed_lag_estimate() gathers; as scratch */
    mirror *mirror;                     /* constant */
    uint8_t *mode;                      /* n: particle belongs to the dominant mode */
    like_patch *estimate_patch;         /* cameras x limbs: surface of the estimate */
    int8_t *known[2][GAIT_MAX_CAMERAS]; /* template as compared in this frame: limbs x LIKE_RING */
    features_scratch scratch;           /* until the particles are weighed; as joint */
    likelihood_scratch *work;           /* tasks, or 1 without threads; all but the first as past */
};

/* First particle of the second side; the number of particles where there is but one side. */
int32_t hypotheses_boundary(const gait_tracker *t);
/* Which of the two sides a particle belongs to. */
static inline int32_t hypothesis_of(const gait_tracker *t, int32_t particle)
{
    return particle >= hypotheses_boundary(t);
}

gait_tracker *tracker_layout(arena *a, const gait_model *m, const gait_tracker_config *cfg,
                             const kernels *run);
void tracker_clear(gait_tracker *t);
/* Since the images last supported the walker. */
static inline float seconds_unseen(const gait_tracker *t)
{
    return 1e-6f * (float)(t->core->utime - t->core->support_utime);
}

/* From now on so many particles are in use. */
void tracker_set_count(gait_tracker *t, int32_t particles);

/* So many are to be used when nothing is searched; the state keeps it. */
void tracker_want(gait_tracker *t, int32_t particles);

/* Particles from the next step on that can change their number: more while the phase is searched. */
int32_t tracker_count(const gait_tracker *t);
dynamics tracker_dynamics(const gait_tracker *t);
void tracker_start(gait_tracker *t, const gait_state *mean, const gait_state *sd, int64_t utime);
gait_result tracker_step(gait_tracker *t, const gait_frame *frame, gait_estimate *out);
#endif
