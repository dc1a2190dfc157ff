/* start.h - fit of a walk to keypoints or boxes of a second: straight and even, or in place.
 *
 * Unknowns: place, heading, speed, phase and rate at the middle of the frames, stature, height of the floor, and the
 * first three scores.  Every heading, phase and mode is scored by its squared error; the best are refined by
 * Levenberg-Marquardt on robust residuals (Student's t), all derivatives from one block of bodies per frame.
 * Boxes do not show the phase: their candidates differ in heading alone. */
#ifndef GAIT_START_START_H
#define GAIT_START_START_H
#include "base/arena.h"
#include "filter/particles.h"
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
    START_FITTED = 12, /* frames of those added that are fitted, evenly spread */
    START_REFINED = 32 /* candidates that are refined */
};

typedef struct start_keypoint { /* of one joint in one frame: ideal pixels; sd 0: not observed */
    double u, v, sd;
} start_keypoint;

typedef struct start_candidate {
    double theta[START_UNKNOWNS];
    double cost; /* squared residuals with the prior's, and twice the prior's odds of the mode */
    double chi2; /* squared residuals of the keypoints, before errors that last are counted as one */
    bool in_place;
} start_candidate;

typedef struct start_scratch start_scratch;

struct gait_start {
    const gait_model *model;
    const kernels *run;
    gait_start_config cfg;
    state_layout layout;
    gait_state prior_sd;      /* where nothing is known about the person */
    int32_t hip[2], ankle[2]; /* points of the model */
    double crown;             /* height of head_top over the floor while walking, statures */
    int32_t count; /* frames of keypoints added, of which the last GAIT_START_MAX_FRAMES are kept */
    int64_t utime[GAIT_START_MAX_FRAMES];
    start_keypoint (*keypoint)[GAIT_MAX_JOINTS]; /* GAIT_START_MAX_FRAMES */
    start_people *people;
    blob_finder blobs;
    start_scratch *scratch;
};

gait_start *start_layout(arena *a, const gait_model *m, const gait_start_config *cfg, const kernels *run);

/* Whether the model has the joints that the start needs. */
bool start_knows(const gait_model *m);

void start_reset(gait_start *s);

void start_add(gait_start *s, int64_t utime, const gait_keypoint *keypoints);

/* Hypotheses for a moment, the most probable first; returns how many, 0 if nothing fits, -1 if there are too few
 * frames. */
int32_t start_solve(gait_start *s, int64_t utime, gait_hypothesis *out, int32_t capacity);

/* Whether it is a walk that fits the observations. */
bool start_walks(const gait_hypothesis *h);
#endif
