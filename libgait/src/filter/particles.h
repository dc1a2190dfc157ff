/* particles.h - the particles as structure of arrays, and their bodies in blocks. */
#ifndef GAIT_FILTER_PARTICLES_H
#define GAIT_FILTER_PARTICLES_H
#include "base/dispatch.h"
#include "model/kinematics.h"
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

typedef struct particle_set {
    int32_t n, fields;
    float *value; /* fields x n */
} particle_set;

static inline float *field(const particle_set *p, int32_t f)
{
    return p->value + (size_t)f * (size_t)p->n;
}

/* Constants that turn fields into bodies. */
typedef struct state_layout {
    const gait_model *model;
    const kernels *run;
    int32_t components, proportions;
    int32_t offsets;                /* how many angles have a posture offset, */
    int32_t angle[GAIT_MAX_ANGLES]; /* and which */
    bool plain_root;                /* paper: no root motion within the stride, pelvis at its mean height */
    float mean_height;              /* statures */
} state_layout;

state_layout state_layout_init(const gait_model *m, const gait_tracker_config *cfg, const kernels *run);

/* First field of the limbs' proportions and of the posture offsets. */
static inline int32_t state_layout_proportion(const state_layout *r)
{
    return F_COEF + r->components;
}

static inline int32_t state_layout_offset(const state_layout *r)
{
    return state_layout_proportion(r) + r->proportions;
}

/* Fields of a particle. */
static inline int32_t state_layout_fields(const state_layout *r)
{
    return state_layout_offset(r) + r->offsets;
}

/* One hypothesis as fields, in SI units. */
typedef struct particle_state {
    float f[F_MAX];
} particle_state;

typedef struct particle_block { /* BLOCK of them, a lane each */
    float f[F_MAX][BLOCK];
} particle_block;

/* The first lanes of a block; nearly all blocks are whole, and of those the compiler knows the size. */
static inline void block_copy(float *restrict to, const float *restrict from, int32_t lanes)
{
    if (lanes == BLOCK)
        memcpy(to, from, BLOCK * sizeof *to);
    else
        memcpy(to, from, (size_t)lanes * sizeof *to);
}

/* Particles index[0 .. lanes); lanes beyond repeat the last. */
void particle_block_get(const particle_set *p, const int32_t *index, int32_t lanes, particle_block *out);
/* The first lanes become particles first .. first + lanes - 1. */
void particle_block_put(particle_set *p, int32_t first, int32_t lanes, const particle_block *w);

/* Weighted mean of the fields that place the region of interest: track, level and stature. */
particle_state particle_set_place(const particle_set *p, const double *weight);

particle_state particle_get(const particle_set *p, int32_t i);
void particle_put(particle_set *p, int32_t i, const particle_state *w);
gait_state particle_to_state(const state_layout *r, const particle_state *w);
/* Ground track and level from a state whose pelvis is given. */
particle_state particle_from_state(const state_layout *r, const gait_state *s);

/* Bodies of particles begin .. begin + BLOCK - 1; lanes beyond n repeat the last particle. */
void particle_set_bodies(const state_layout *r, const particle_set *p, int32_t begin, kin_body *out);
void particle_block_bodies(const state_layout *r, const particle_block *w, kin_body *out);
void particle_body(const state_layout *r, const particle_state *w, kin_body *out); /* in every lane */

/* What kin_pace says of a walker; 0 in paper mode. */
float state_layout_pace(const state_layout *r, float stride_hz);

/* Channel c (ROOT_*) at a phase: eq. 3 for one function. */
float root_channel(const gait_model *m, int32_t c, float phase, float pace, const float *coef,
                   int32_t components);
#endif
