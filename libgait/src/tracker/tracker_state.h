/* tracker_state.h - everything a tracker keeps: the state that is saved and hashed, and the working memory of a step.
 *
 * The parts of a step (features_step, likelihood_step, hypotheses, track_loss, front_back, estimate) read this struct and
 * report a result; tracker.c calls them in order and writes tracker_core. */
#ifndef GAIT_TRACKER_TRACKER_STATE_H
#define GAIT_TRACKER_TRACKER_STATE_H
#include "base/task.h"
#include "filter/dynamics.h"
#include "filter/mirror.h"
#include "filter/pf.h"
#include "likelihood/template.h"

/* Which readings of left and right the particles represent (hypotheses.h). */
enum { HYPOTHESES_ONE, HYPOTHESES_ACQUISITION, HYPOTHESES_TWO };
typedef struct hypotheses_state {
    int32_t stage;
    int32_t left_right_known; /* left and right have been decided before */
    int32_t phase_known;      /* in acquisition: the phase is known, but for the side */
    int32_t agreed; /* in acquisition with known phases: those of the start agreed in the last frame */
    int64_t since;  /* when the stage began, microseconds */
    /* Of the second hypothesis over the first (HYPOTHESES_TWO); before the images have proven an automatic start: of a
     * person over no person, at most 0. */
    double log_odds;
    double recent_log_ratio; /* the second over the first, all terms, over the last few frames, nats */
} hypotheses_state;

/* Saved and hashed in this order, followed by the arrays of gait_tracker up to state_end; a change of either raises FORMAT
 * of snapshot.c. */
typedef struct tracker_core {
    int64_t utime, start_utime;
    int64_t support_utime; /* when an image last supported the estimate */
    int64_t
        rejuvenation_utime; /* of the last rejuvenation, or of the last step in acquisition or while lost */
    uint64_t frame;         /* steps since start */
    int32_t started;
    int32_t generation;       /* slot of the history that holds the current particles */
    uint32_t sampled_cameras; /* bit c: there are surface samples of camera c's previous frame */
    int32_t found; /* since the start, images have supported the estimate and proven that a person is there */
    int32_t partly_hidden;   /* the last image supports only parts of the body */
    float stature_sd_ratio;  /* standard deviation of stature at the start, fraction of the stature */
    float usual_unexplained; /* foreground that the estimate usually leaves unexplained, nats */
    float front_back_margin; /* running mean of front_back_score() */
    float left_right_margin; /* log odds of the estimate's sides over the mirror image (left_right.h) */
    float fit_margin;        /* running mean of fit_check_score() */
    double ess;
    hypotheses_state hypotheses;
    particle_state last_supported;       /* the estimate when an image last supported it */
    float reported_phase, reported_rate; /* of the last estimate; strides, strides per second */
    view_map map[GAIT_MAX_CAMERAS];
    int32_t below_capacity; /* particles in use: gait_tracker.capacity less this */
    int32_t below_config; /* particles wanted outside acquisition: gait_tracker.config_particles less this */
} tracker_core;

/* Paper mode: an estimate of the last fifth of a second (walk_check.h). */
typedef struct walk_check {
    int64_t age;      /* its time since the start, microseconds */
    uint32_t cameras; /* bit c: camera c has surface samples of it; 0: there is none yet */
    int32_t judged;   /* 1: nats is known */
    /* Log-likelihood ratio of its surface having walked on over having stayed, mean of the last two. */
    float nats;
    particle_state body;
} walk_check;
/* Ranges of particles, each of one class of motion, those of the second hypothesis after those of the first. */
enum { MAX_STRATA = 2 * GAIT_MAX_CLASSES };
/* Every class has at least one in CLASS_SHARE of the particles that a single class would have. */
enum { CLASS_SHARE = 8 };

typedef struct strata {
    int32_t count;
    int32_t first[MAX_STRATA + 1];
    int32_t motion_class[MAX_STRATA];
} strata;

typedef struct class_state { /* of a model with several classes (class_strata.h) */
    /* Microseconds since the start: last resampling; last estimate that moves. */
    int64_t resampled, moved;
    int32_t moved_class;         /* of that estimate; of the start, if none has moved */
    int32_t reported, supported; /* class of the last estimate, and of core.last_supported */
    int32_t open_sides;          /* 1: the person stood still, so left and right will be split */
    uint32_t known;              /* bit c: there are scores of the person in class c */
    /* Of the estimates that stand, over the ground, mean of the last ones: metres per second. */
    float drift[2];
    float score[GAIT_MAX_CLASSES][GAIT_MAX_COMPONENTS];
} class_state;

typedef struct camera_state {
    features features;
    view_planes plate;     /* background resampled to the region of interest */
    gait_image background; /* borrowed; data NULL: none */
    bool plate_stale;
    bool moved;              /* in this frame the camera is not where the config puts it */
    float turn_sd, place_sd; /* of its pose: radians, metres */
    float shift_sd; /* of the shift of its image by an error of its pose, pixels; 0: the pose is exact */
    float aim[2];   /* if it is not: where the predicted pelvis is before that shift, ideal pixels */
} camera_state;

typedef struct likelihood_scratch { /* one per task; its arrays are as long as the model's limbs and points */
    kin_body body;
    outline_block *outline;
    layers_block *lines;
    like_outline *sides;
    like_pose *pose;
    layers *layers;
    like_block terms;
    float (*points)[3][BLOCK];
    float (*home)[3][BLOCK]; /* origins of the frames, then points, of a body before it was displaced */
} likelihood_scratch;

typedef struct generation_record { /* what an estimate reports of its frame as a whole */
    int64_t age;                   /* microseconds since start */
    uint64_t frame;
    double log_evidence;
    int32_t status;
    uint32_t flags;
} generation_record;

/* The last generations of particles: a ring, in which the lagged estimate follows ancestors. */
typedef struct particle_history {
    int32_t depth; /* generations kept: the configured lag and the current one */
    int32_t capacity, fields;
    generation_record *record; /* depth */
    int32_t *count;            /* depth: particles of each generation */
    strata *strata;            /* depth; NULL: one class */
    float *value;              /* depth x fields x capacity, of which fields x count are in use */
    int32_t *parent;           /* depth x capacity: indices into the generation before */
} particle_history;

typedef struct lag_scratch { /* of fixed_lag_estimate() */
    int32_t *ancestor;       /* capacity: those that have descendants among the current particles */
    double *weight;          /* capacity: total weight of these descendants */
    float *column[3]; /* capacity: the ancestors' values of a field; the memory of the log-likelihoods */
} lag_scratch;

/* Joints of particles: x, y and z of every joint of the model, which are 3 x points numbers each. */
typedef struct joint_scratch {
    int32_t most;                /* particles whose joints fit */
    float *value;                /* 3 x points x most, metres, world */
    double (*sum)[3][SUM_LANES]; /* 3 x points: running sums of estimate_moments */
} joint_scratch;

struct gait_tracker {
    const gait_model *model;
    gait_tracker_config cfg;            /* particles: those in use now; camera: as it is in this frame */
    gait_camera home[GAIT_MAX_CAMERAS]; /* of the caller's config */
    int32_t config_particles;           /* of the caller's config */
    int32_t target_particles;           /* that the caller wants outside acquisition */
    int32_t capacity;                   /* particles that fit into the memory */
    state_layout layout;                /* of the first class */
    like_setup *like;
    /* Mutable state: one block of memory from core to state_end. */
    tracker_core *core;
    /* n x cameras x limbs: surface samples of the particles; of their ancestors until the likelihood step replaces them.
     * NULL: no term needs them. */
    like_patch *texture;
    pf filter;
    /* Appearance under each hypothesis; with one hypothesis only the first. */
    int16_t *template[2][GAIT_MAX_CAMERAS];
    particle_history history;
    walk_check *walk_check;       /* NULL: not in paper mode */
    like_patch *walk_check_patch; /* cameras x limbs: the surface of its body */
    class_state *classes;         /* NULL: one class */
    unsigned char *state_end;
    particle_set particles; /* the current generation */
    /* Recomputed in every step. */
    camera_state camera[GAIT_MAX_CAMERAS];
    float *loglik_raw;                /* n: log-likelihood, all terms and cameras */
    float *loglik_without_silhouette; /* n */
    union {                           /* one array of n: */
        float *explained; /* after the likelihood step: foreground that each particle explains, nats; */
        float *loglik;    /* after track_loss_bound(): the log-likelihood that moves the weights */
    };
    /* Until the features are computed, in the memory of the arrays of work: scratch of the resampling, then
     * rejuvenation_rows() or a copy of the generation before, then scratch of the split. */
    float *rows;
    features_scratch planes; /* until the features are complete; in the same memory */
    joint_scratch joints;    /* of all particles after the likelihood step, if they fit */
    state_layout *layouts;   /* of every class; constant */
    mirror *mirror;          /* of every class; constant */
    strata *next;            /* with several classes: ranges of the particles after resampling */
    union {                  /* one array of n: */
        uint8_t *origin;     /* until the particles have moved: class of their ancestors; */
        uint8_t *dominant;   /* from the estimate on: 1 for particles of the dominant hypothesis */
    };
    like_patch *estimate_patch; /* cameras x limbs: surface samples of the estimate */
    /* limbs x LIKE_RING: the templates in the form of template_ring(), for this frame. */
    int8_t *template_ring[2][GAIT_MAX_CAMERAS];
    likelihood_scratch *work; /* tasks, or 1 without threads */
    lag_scratch lag; /* ancestor and weight: in the memory of work[1] and later; without a lag NULL */
};

/* Place a tracker in memory; NULL if the arena only counts.  run: the kernels to use; NULL: when counting. */
gait_tracker *tracker_layout(arena *a, const gait_model *m, const gait_tracker_config *cfg,
                             const kernels *run);
void tracker_clear(gait_tracker *t);

/* Set the number of particles in use. */
void tracker_set_count(gait_tracker *t, int32_t particles);

/* Set target_particles, which the saved state records. */
void tracker_set_target(gait_tracker *t, int32_t particles);

/* Particles the next step should use, if it can change their number: up to twice the target during acquisition. */
int32_t tracker_count(const gait_tracker *t);

/* Give all particles the same weight and no ancestors but themselves. */
void tracker_even_weights(gait_tracker *t);

dynamics tracker_dynamics(const gait_tracker *t, int32_t motion_class);

/* Particles in a slot of the history. */
particle_set history_particles(const particle_history *h, int32_t slot);
static inline int32_t *history_parents(const particle_history *h, int32_t slot)
{
    return h->parent + (size_t)slot * (size_t)h->capacity;
}

/* The slot `back` generations before another. */
static inline int32_t history_slot(const particle_history *h, int32_t slot, int32_t back)
{
    return (slot + h->depth - back) % h->depth;
}

/* Ranges of the current particles by class; only with several classes. */
static inline strata *tracker_strata(const gait_tracker *t)
{
    return &t->history.strata[t->core->generation];
}

int32_t stratum_at(const strata *s, int32_t particle);

/* Whether people of a class stand. */
static inline bool class_stands(const gait_tracker *t, int32_t motion_class)
{
    return t->layouts[motion_class].model->direction == 0;
}

/* Class of a current particle, and its layout. */
int32_t class_at(const gait_tracker *t, int32_t particle);
const state_layout *layout_at(const gait_tracker *t, int32_t particle);

/* Surface samples of particle i in camera c by limb, or NULL. */
static inline like_patch *texture_of(const gait_tracker *t, int32_t i, int32_t c)
{
    size_t const at = ((size_t)i * (size_t)t->cfg.cameras + (size_t)c) * (size_t)t->like->limbs;
    return t->texture ? t->texture + at : NULL;
}

static inline bool uses_texture(const gait_tracker_config *cfg)
{
    return (cfg->terms & (GAIT_TERM_TEXTURE | GAIT_TERM_TEMPLATE)) != 0;
}

/* First particle of a hypothesis of two; hypothesis 2: the end. */
static inline int32_t hypothesis_first(int32_t n, int32_t hypothesis)
{
    return hypothesis == 0 ? 0 : hypothesis == 1 ? (n + 1) / 2 : n;
}

/* First particle of the second hypothesis; the number of particles if there is only one. */
static inline int32_t hypotheses_boundary(const gait_tracker *t)
{
    return hypothesis_first(t->filter.n, t->core->hypotheses.stage == HYPOTHESES_TWO ? 1 : 2);
}

static inline int32_t hypothesis_of(const gait_tracker *t, int32_t particle)
{
    return particle >= hypotheses_boundary(t);
}

static inline float seconds_since(const gait_tracker *t, int64_t utime)
{
    return 1e-6f * (float)(t->core->utime - utime);
}

/* An interval between frames as the person experiences it: negative if frames come in reverse order. */
static inline float in_walking_time(const gait_tracker *t, float seconds)
{
    return t->cfg.reverse > 0.0 ? -seconds : seconds;
}

/* Distance along its heading that a body covers in so many seconds if it walks on, metres; a belt cancels its share. */
static inline float way_of_walk(const gait_tracker *t, const state_layout *of, const particle_state *from,
                                float seconds)
{
    return (1.0f - (float)t->cfg.belt) * in_walking_time(t, seconds) * particle_speed(of, from) *
           (float)of->model->direction;
}

/* Seconds since an image last supported the estimate. */
static inline float seconds_unsupported(const gait_tracker *t)
{
    return seconds_since(t, t->core->support_utime);
}

/* Update a running mean over so many seconds by this frame's score; a score of 0 changes nothing. */
static inline float running_mean(const gait_tracker *t, float before, float score, float seconds)
{
    float const share = f_min(seconds_unsupported(t) / seconds, 1.0f);
    return before + (score == 0.0f ? 0.0f : share * (score - before));
}
#endif
