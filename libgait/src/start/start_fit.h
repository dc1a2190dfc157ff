/* start_fit.h - fit of a walk to the observations of a second: straight and even, or in place.
 *
 * Unknowns: place, heading, speed, phase and rate at the middle of the frames, stature, height of the floor, and the
 * first three scores.  Every heading, phase and mode is scored by its squared error, in every class of the model that
 * takes strides; the best are refined by Levenberg-Marquardt on robust residuals (Student's t), all derivatives from one
 * block of bodies per frame.  Boxes do not show the phase: their candidates differ in heading alone, and are of the first
 * class. */
#ifndef GAIT_START_START_FIT_H
#define GAIT_START_START_FIT_H
#include "base/arena.h"
#include "filter/dynamics.h"
#include "gait_start.h"
#include "start/blobs.h"
#include "start/people.h"

enum {
    START_X,
    START_Y,
    START_HEADING,
    START_SPEED,
    START_PHASE,
    START_RATE,
    START_STATURE,
    START_FLOOR,
    START_SCORE,
    START_SCORES = 3,
    START_UNKNOWNS = START_SCORE + START_SCORES,
    START_FITTED = 12,  /* frames of those added that are fitted, evenly spread */
    START_REFINED = 32, /* candidates that are refined */
    START_HEADINGS = 12,
    START_PHASES = 6,
    START_CANDIDATES =
        START_REFINED + START_HEADINGS * START_PHASES, /* the best so far, and those of a mode */
    START_LD = 16,                                     /* cholesky_padded(START_UNKNOWNS + 1) */
    START_ROWS = 2 * GAIT_MAX_JOINTS,                  /* of a frame */
    START_BOX_ROWS = 4                                 /* foot and crown */
};
_Static_assert((int)START_UNKNOWNS < (int)BLOCK, "a block of bodies holds a candidate and its derivatives");

typedef struct start_candidate {
    double theta[START_UNKNOWNS];
    double cost; /* squared residuals with the prior's, and twice the prior's odds of the mode and class */
    double chi2; /* squared residuals of the keypoints, without the factor for errors that last */
    const state_layout *layout; /* of its class */
    bool in_place;
} start_candidate;

typedef struct start_problem {           /* the observations that all candidates are fitted to */
    const start_person *person;          /* whose boxes are fitted; NULL: keypoints are */
    int32_t frames, frame[START_FITTED]; /* in the ring */
    double at[START_FITTED];             /* seconds from the middle */
    double share;                        /* factor of a frame's squared residuals, because errors last */
    int32_t observations;
    double place[2];
    int64_t middle;
} start_problem;

typedef struct start_scratch { /* of one fit */
    start_problem problem;
    start_candidate candidate[START_CANDIDATES];
    particle_block states;
    kin_body body;
    float points[GAIT_MAX_JOINTS][3][BLOCK];
    double A[START_LD * START_LD], U[START_LD * START_LD], W[(START_ROWS + START_UNKNOWNS) * START_LD];
    double inverse_sd[START_FITTED][GAIT_MAX_JOINTS]; /* 0: not observed */
    double residual[START_ROWS][BLOCK];
} start_scratch;

typedef struct start_keypoint { /* of one joint in one frame: ideal pixels; sd 0: not observed */
    double u, v, sd;
} start_keypoint;

struct gait_start { /* observations, and what is known about the person */
    const gait_model *model;
    const kernels *run;
    gait_start_config cfg; /* camera: as it is now */
    int32_t striding;
    state_layout
        layout[GAIT_MAX_CLASSES]; /* of the classes that take strides: the model's first one, then others */
    gait_state prior_sd;          /* of what is not known about the person */
    int32_t hip[2], ankle[2];     /* points of the model */
    double crown;                 /* height of head_top over the floor while walking, statures */
    int32_t count; /* frames of keypoints added, of which the last GAIT_START_MAX_FRAMES are kept */
    int64_t utime[GAIT_START_MAX_FRAMES];
    start_view view[GAIT_START_MAX_FRAMES];
    start_keypoint (*keypoint)[GAIT_MAX_JOINTS]; /* GAIT_START_MAX_FRAMES */
    start_people *people;
    blob_finder blobs;
    start_scratch *scratch;
};

/* The camera in one of the frames that are fitted. */
gait_camera start_camera(const gait_start *s, int32_t k);

/* Fit walks to the scratch's problem: candidates that differ, at most capacity, the best first; returns how many. */
int32_t start_fit(const gait_start *s, int32_t capacity);

/* State of a candidate at a moment (seconds from the middle of the frames), with its standard deviations; returns the
 * log of the root of the determinant of its covariance. */
double start_describe(const gait_start *s, const start_candidate *c, double at, gait_hypothesis *h);
#endif
