/* particles.h - the particle set as a structure of arrays, and the bodies of particles in blocks. */
#ifndef GAIT_FILTER_PARTICLES_H
#define GAIT_FILTER_PARTICLES_H
#include "base/dispatch.h"
#include "model/kinematics.h"
#include <string.h>

#define LEAST_STATURE 0.3f  /* metres: the smallest stature of a particle */
#define MOST_SD       10.0f /* of any field of the state from which particles are drawn */

/* One float array per field. (X, Y) is the smooth path over the ground and Z the height of the ground under
 * the person; the pelvis follows from the model's sway and height (ROOT_*). */
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
    F_TURN, /* turn rate: rate of change of the heading */
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

/* Constants that map fields to bodies. */
typedef struct state_layout {
    const gait_model *model; /* of one class of motion */
    const kernels *run;
    int32_t components, proportions; /* numbers of scores of a particle */
    int32_t curve_components;        /* the first ones, which the curves of this class have */
    int32_t offsets;                 /* number of angles with a posture offset */
    int32_t angle[GAIT_MAX_ANGLES];  /* their indices */
    bool plain_root;   /* paper mode: no root motion within the stride, pelvis at its mean height */
    float mean_height; /* statures */
} state_layout;

/* The layout of the first class. */
state_layout state_layout_init(const gait_model *m, const gait_tracker_config *cfg, const kernels *run);

/* The same fields with the curves of another class. */
state_layout state_layout_of_class(const state_layout *first, int32_t motion_class);

/* First field of the limbs' proportions, and of the posture offsets. */
static inline int32_t state_layout_proportion(const state_layout *r)
{
    return F_COEF + r->components;
}

static inline int32_t state_layout_offset(const state_layout *r)
{
    return state_layout_proportion(r) + r->proportions;
}

/* Number of fields of a particle. */
static inline int32_t state_layout_fields(const state_layout *r)
{
    return state_layout_offset(r) + r->offsets;
}

/* The state of one particle as fields, in SI units. */
typedef struct particle_state {
    float f[F_MAX];
} particle_state;

typedef struct particle_block { /* BLOCK particle states, one per lane */
    float f[F_MAX][BLOCK];
} particle_block;

/* Copy the first lanes of a block. Nearly all blocks are complete, and for those the size is a constant. */
static inline void block_copy(float *restrict to, const float *restrict from, int32_t lanes)
{
    if (lanes == BLOCK)
        memcpy(to, from, BLOCK * sizeof *to);
    else
        memcpy(to, from, (size_t)lanes * sizeof *to);
}

/* Particles index[0 .. lanes). The remaining lanes repeat the last one. */
void particle_block_get(const particle_set *p, const int32_t *index, int32_t lanes, particle_block *out);
/* The first lanes become particles first .. first + lanes - 1. */
void particle_block_put(particle_set *p, int32_t first, int32_t lanes, const particle_block *w);

/* Weighted mean of the fields that place the region of interest: path, ground level and stature. */
particle_state particle_set_place(const particle_set *p, const double *weight);

particle_state particle_get(const particle_set *p, int32_t i);
void particle_put(particle_set *p, int32_t i, const particle_state *w);
gait_state particle_to_state(const state_layout *r, const particle_state *w);
/* A particle from a state with a given pelvis: path and ground level follow. */
particle_state particle_from_state(const state_layout *r, const gait_state *s);

/* Bodies of particles begin .. begin + BLOCK - 1. Lanes from n on repeat the last particle. */
void particle_set_bodies(const state_layout *r, const particle_set *p, int32_t begin, kin_body *out);
void particle_block_bodies(const state_layout *r, const particle_block *w, kin_body *out);
/* The same body in every lane. */
void particle_body(const state_layout *r, const particle_state *w, kin_body *out);

/* kin_pace of a stride rate; 0 in paper mode. */
float state_layout_pace(const state_layout *r, float stride_hz);

/* Speed along the ground, metres per second: stride length times stride rate. */
float particle_speed(const state_layout *r, const particle_state *p);

/* Channel c (ROOT_*) at a phase: eq. 3 for one channel. */
float root_channel(const gait_model *m, int32_t c, float phase, float pace, const float *coef,
                   int32_t components);
#endif
