#ifndef TOY_SHIFTED_H
#define TOY_SHIFTED_H

#include "model/model.h"
#include "toy_model.h"

/* The toy model with proportions that also move the shoulders (section SHFT) and with strides that are longer at higher
 * rates (section PACE). */
static inline const gait_model *toy_shifted(void)
{
    static float shift[TOY_PROPORTIONS][TOY_FRAMES][3];
    static gait_model model;
    model = *toy_model();
    for (int side = 0; side < 2; side++) {
        float const to[3] = {0.03f, side ? 0.01f : -0.01f, 0.02f};
        memcpy(shift[0][3 + 5 * side], to, sizeof to);
    }
    model.shift = shift[0][0];
    model.pace_curve = model.curves + model.phases * model.channels; /* the first component is stride size */
    return &model;
}

#endif
