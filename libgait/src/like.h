/* like.h - the likelihood of one body in one camera: terms behind one small interface.
 *
 * Each term is an average (per limb, per area, per outline) times a weight in nats, so that pixels which
 * are not independent do not count as if they were (spec R13).  log p(frames | body) is the sum over terms
 * and cameras. */
#ifndef GAIT_LIKE_H
#define GAIT_LIKE_H
#include "features.h"
#include "kernels.h"
#include "layers.h"

enum {
    LIKE_ROWS = 4,
    LIKE_AZIMUTHS = 8,
    LIKE_SAMPLES = LIKE_ROWS * LIKE_AZIMUTHS, /* surface points of a limb */
    LIKE_TERMS = 4,
    LIKE_COSTS = 256,   /* entries of the robust cost table */
    LIKE_COST_ONE = 256 /* 1 nat in that table */
};

typedef struct like_surface { /* fixed points on one limb (spec 1.6.2), statures; same for every particle */
    float point[3][LIKE_SAMPLES];
    float normal[3][LIKE_SAMPLES];
} like_surface;

typedef struct like_setup { /* constant while a tracker lives */
    const kernels *run;
    int32_t limbs;
    bool paper;     /* literal eqs. 10-13 */
    uint32_t terms; /* GAIT_TERM_* */
    float weight[LIKE_TERMS];
    float missed_weight;
    limb_geometry geometry[MODEL_MAX_LIMBS];
    like_surface surface[MODEL_MAX_LIMBS];
    int16_t cost[LIKE_COSTS]; /* robust cost of a surface difference, LIKE_COST_ONE = 1 nat */
} like_setup;

typedef struct like_body { /* one body in one camera, as the terms see it */
    const like_setup *setup;
    const features *features;
    const outline_block *outline;
    int32_t lane;
    const layers *layers;
    const int8_t *seen;      /* limbs x LIKE_SAMPLES: its surface in this frame, or TEXTURE_HIDDEN */
    const int8_t *ancestor;  /* the same of its ancestor in the previous frame, or NULL */
    const int16_t *template; /* running appearance (like_template.h), or NULL */
} like_body;

typedef struct like_term {
    const char *name;
    uint32_t flag;                               /* GAIT_TERM_* */
    float (*log_likelihood)(const like_body *b); /* nats, without its weight */
    float (*support)(const like_body *b);        /* the same over "nobody is there"; NULL: no opinion */
} like_term;

extern const like_term like_texture, like_silhouette, like_edges, like_template;

void like_setup_init(like_setup *s, const gait_model *m, const gait_tracker_config *cfg);

/* Look up the surface of every limb in the frame: limbs x LIKE_SAMPLES. */
void like_sample(const like_setup *s, const features *f, const gait_camera *cam, const kin_body *body,
                 int32_t lane, const layers *drawn, int8_t *seen);

/* Sum of the weighted terms in use. */
float like_evaluate(const like_body *b);

/* One term's part in it. */
float like_one(const like_body *b, const like_term *term);

/* Sum of the weighted terms over the hypothesis that nobody is there: positive if the frame shows this
 * body. */
float like_support(const like_body *b);

/* Mean robust cost between two sets of surface samples of a limb; returns how many were seen in both. */
int32_t like_compare(const like_setup *s, const int8_t *a, const int8_t *b, int32_t *cost);
#endif
