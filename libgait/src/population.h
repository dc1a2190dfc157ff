/* population.h - the particles as structure of arrays, and their bodies in blocks. */
#ifndef GAIT_POPULATION_H
#define GAIT_POPULATION_H
#include "kernels.h"
#include "kinematics.h"
#include <string.h>

/* One float array per field.  (X, Y) is the smooth track over the ground and Z the ground's height under
 * the walker; the pelvis follows by the model's sway and height (ROOT_*). */
#define LEAST_STATURE 0.3f /* metres: no particle gets smaller */

enum {
    F_PHASE,
    F_RATE,
    F_X,
    F_Y,
    F_Z,
    F_HEADING,
    F_PITCH,
    F_ROLL,
    F_STATURE,
    F_TURN, /* rate of the heading */
    F_COEF, /* the scores, then the limbs' proportions, then the posture of the angles that have an offset */
    F_MAX = F_COEF + GAIT_MAX_COMPONENTS + GAIT_MAX_PROPORTIONS + GAIT_MAX_ANGLES
};

typedef struct population {
    int32_t n, fields;
    float *value; /* fields x n */
} population;

static inline float *field(const population *p, int32_t f)
{
    return p->value + (size_t)f * (size_t)p->n;
}

/* Constants that turn fields into bodies. */
typedef struct body_rule {
    const gait_model *model;
    const kernels *run;
    int32_t components, proportions;
    int32_t offsets;                /* how many angles have a posture offset, */
    int32_t angle[GAIT_MAX_ANGLES]; /* and which */
    bool plain_root;                /* paper: no root motion within the stride, pelvis at its mean height */
    float mean_height;              /* statures */
} body_rule;

body_rule body_rule_init(const gait_model *m, const gait_tracker_config *cfg);

/* First field of the limbs' proportions and of the posture offsets. */
static inline int32_t body_rule_proportion(const body_rule *r)
{
    return F_COEF + r->components;
}

static inline int32_t body_rule_offset(const body_rule *r)
{
    return body_rule_proportion(r) + r->proportions;
}

/* Fields of a particle. */
static inline int32_t body_rule_fields(const body_rule *r)
{
    return body_rule_offset(r) + r->offsets;
}

/* One hypothesis as fields, in SI units. */
typedef struct walker {
    float f[F_MAX];
} walker;

typedef struct walker_block { /* BLOCK of them, a lane each */
    float f[F_MAX][BLOCK];
} walker_block;

/* The first lanes of a block; nearly all blocks are whole, and of those the compiler knows the size. */
static inline void block_copy(float *restrict to, const float *restrict from, int32_t lanes)
{
    if (lanes == BLOCK)
        memcpy(to, from, BLOCK * sizeof *to);
    else
        memcpy(to, from, (size_t)lanes * sizeof *to);
}

/* Particles index[0 .. lanes); lanes beyond repeat the last. */
void walker_block_get(const population *p, const int32_t *index, int32_t lanes, walker_block *out);
/* The first lanes become particles first .. first + lanes - 1. */
void walker_block_put(population *p, int32_t first, int32_t lanes, const walker_block *w);

/* Weighted mean of the fields that place the region of interest: track, level and stature. */
walker population_place(const population *p, const double *weight);

walker walker_get(const population *p, int32_t i);
void walker_put(population *p, int32_t i, const walker *w);
gait_state walker_state(const body_rule *r, const walker *w);
/* Ground track and level from a state whose pelvis is given. */
walker walker_from_state(const body_rule *r, const gait_state *s);

/* Bodies of particles begin .. begin + BLOCK - 1; lanes beyond n repeat the last particle. */
void population_bodies(const body_rule *r, const population *p, int32_t begin, kin_body *out);
void walker_block_bodies(const body_rule *r, const walker_block *w, kin_body *out);
void walker_body(const body_rule *r, const walker *w, kin_body *out); /* in every lane */

/* What kin_pace says of a walker; 0 in paper mode. */
float body_rule_pace(const body_rule *r, float stride_hz);

/* Channel c (ROOT_*) at a phase: eq. 3 for one function. */
float root_channel(const gait_model *m, int32_t c, float phase, float pace, const float *coef,
                   int32_t components);
#endif
