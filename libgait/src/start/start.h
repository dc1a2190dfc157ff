/* start.h - automatic start: from the keypoints or boxes of a second to weighted hypotheses of a person who walks.
 *
 * It keeps the observations, chooses the frames, and asks start_fit.h for the walks that fit them. */
#ifndef GAIT_START_START_H
#define GAIT_START_START_H
#include "start/start_fit.h"

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
