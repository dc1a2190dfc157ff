/* class_change.h - a particle changes its class of motion: a jump Markov model (doc/method.md). */
#ifndef GAIT_FILTER_CLASS_CHANGE_H
#define GAIT_FILTER_CLASS_CHANGE_H
#include "filter/dynamics.h"

/* Changes per second from the class of view m to another, at a phase and stride rate. */
float class_change_rate(const gait_model *m, int32_t to, float phase, float stride_hz);

typedef struct class_entry {    /* how particles begin in a class */
    const state_layout *layout; /* of the class */
    uint64_t seed;
    uint32_t frame;     /* counter of the random numbers */
    const float *score; /* scores of the person in that class */
    float score_sd;     /* their standard deviation */
    bool resumes;  /* the person has stood for a moment only, perhaps not at all, and moved in this class: */
    float phase;   /* before that, */
    float seconds; /* since when they may have gone on */
} class_entry;

/* Particle i, until now of class `from`. */
void class_change_enter(const class_entry *e, int32_t from, int32_t i, particle_state *p);
#endif
