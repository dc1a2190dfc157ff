/* segment_prior.h - the prior over motion segments of a blob as typed views. Lengths are fractions of
 * stature. */
#ifndef GAIT_MODEL_SEGMENT_PRIOR_H
#define GAIT_MODEL_SEGMENT_PRIOR_H
#include "model/blob.h"

enum { SEGMENT_NAME = 32 }; /* bytes of a name */

typedef struct segment_prior {
    int32_t markers, frames;   /* J, F */
    int32_t hop;               /* frames from one segment to the next, [1, F] */
    int32_t headings;          /* 0: heading-normalised; otherwise number of rotated copies, in world axes */
    int32_t components, modes; /* K Gaussians of k modes each */
    float fps;
    float gamma;   /* factor of the residual variance, fitted to held-out recordings */
    float stature; /* mean of the people in the training data, metres */

    const char (*name)[SEGMENT_NAME]; /* J */
    const float *weight;              /* K */
    const float *mean;                /* K x F x J x 3 */
    const float *mode;                /* K x k x F x J x 3, times their standard deviations */
    const float *sd;                  /* K x k: these standard deviations */
    const float *residual;            /* K x J: variance per coordinate outside the modes */
} segment_prior;

/* Check the segment sections of a blob and fill p with views into it; err names the section at fault. */
gait_result segment_open(const blob *b, segment_prior *p, gait_error *err);

/* Mean of component c at frame f, (J x 3); mode i of component c at frame f, (J x 3). */
static inline const float *segment_mean(const segment_prior *p, int32_t c, int32_t f)
{
    return p->mean + ((size_t)c * (size_t)p->frames + (size_t)f) * (size_t)p->markers * 3;
}

static inline const float *segment_mode(const segment_prior *p, int32_t c, int32_t i, int32_t f)
{
    size_t const row = ((size_t)c * (size_t)p->modes + (size_t)i) * (size_t)p->frames + (size_t)f;
    return p->mode + row * (size_t)p->markers * 3;
}
#endif
