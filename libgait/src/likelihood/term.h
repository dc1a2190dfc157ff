/* term.h - the likelihood of one body in one camera: terms behind one small interface.
 *
 * Each term is an average (per limb, per area, per outline) times a weight in nats, so that pixels which are not
 * independent do not count as if they were (as in Ormoneit et al. 2000, eq. 11).  log p(frames | body) is the sum over
 * terms and cameras. */
#ifndef GAIT_LIKELIHOOD_TERM_H
#define GAIT_LIKELIHOOD_TERM_H
#include "image/features.h"
#include "base/dispatch.h"
#include "raster/layers.h"

/* The terms, in the order of gait_tracker_config.term_weight. */
enum { LIKE_TEXTURE, LIKE_SILHOUETTE, LIKE_EDGES, LIKE_TEMPLATE, LIKE_KEYPOINTS, LIKE_TERMS };

enum {
    LIKE_ROWS = 4,
    LIKE_AZIMUTHS = 8,
    LIKE_SAMPLES = LIKE_ROWS * LIKE_AZIMUTHS, /* surface points of a limb */
    LIKE_DIRECTIONS =
        2 * LIKE_AZIMUTHS,        /* rings are staggered by half a step: two points face each of these */
    LIKE_HALF = LIKE_SAMPLES / 2, /* points of the half turned to the camera */
    LIKE_RING = LIKE_SAMPLES + LIKE_HALF, /* once around and on, so that every half is in one piece */
    LIKE_FEW = 8,            /* points seen in both frames below which a limb counts as occluded */
    LIKE_COSTS = 256,        /* entries of a cost table */
    LIKE_COST_ONE = 256,     /* 1 nat in the robust one */
    LIKE_COUNT_ONE = 1 << 24 /* in every entry: a sum of costs counts the points as well */
};

/* Visibility of an outline's point is looked up so far on its way to the limb's middle. */
#define LIKE_INWARD         0.3f
#define LIKE_PAPER_OCCLUDED (-6.3200f) /* log 0.0018 per grey level: N(0, 10^2) at 2.5 sd */

/* Fixed points on one limb, statures; same for every particle.  Points 2 d and 2 d + 1 face
 * direction d; direction d + LIKE_AZIMUTHS is the opposite one. */
typedef struct like_surface {
    float point[3][LIKE_RING];
    float normal[3][LIKE_RING];
    float outward[LIKE_RING];     /* normal times point */
    float middle[3];              /* of the limb's axis */
    float side[3][LIKE_AZIMUTHS]; /* the first half of the directions */
} like_surface;

/* Numbers of one body about one limb, a line of the cache: of its view and, in one part, of a cone's sides. */
enum {
    LIKE_WORDS = 16,
    LIKE_SUBPIXELS = 256, /* of a working pixel, in one direction */
    LIKE_CELL_BITS = 9    /* of them in a cell of the grid, which has two pixels */
};
enum { LIKE_VIEW_IMAGE = 0, LIKE_VIEW_SHIFT = 9, LIKE_VIEW_ORIGIN = 12, LIKE_VIEW_GRAZE = 15 };
enum {
    LIKE_SIDE_X = 0,
    LIKE_SIDE_Y = 2,
    LIKE_SIDE_DX = 4,
    LIKE_SIDE_DY = 6,
    LIKE_SIDE_NORMAL = 8,
    LIKE_SIDE_INNER = 10
};

/* A limb of BLOCK bodies: image (3 x 3), shift (3), eye (3), graze.  A surface point p shows at
 * (x, y) = (image[0] p + shift[0], image[1] p + shift[1]) / (image[2] p + shift[2]), 1/256 working pixels; its normal n
 * is turned away unless n eye + n p < graze, where eye leads from the camera to the frame's origin, in the frame,
 * statures. */
typedef struct like_pose_limb {
    float view[BLOCK][LIKE_WORDS];
    int32_t turn[BLOCK]; /* first of the LIKE_AZIMUTHS directions that can face the camera */
} like_pose_limb;

typedef struct like_pose {
    like_pose_limb limb[MODEL_MAX_LIMBS];
} like_pose;

/* Sides of a limb's outline in BLOCK bodies, body by body, so that each reads few lines of the cache: where they begin
 * and their vectors (x, y, dx, dy), working pixels; the double-angle form of their normals, cos2 + 2^16 sin2 in whole
 * numbers, 64 = 1, cos2 modulo 2^16; LIKE_INWARD times the limb's middle (inner_x, inner_y), cells. */
typedef struct like_sides {
    float part[3][BLOCK][LIKE_WORDS];
} like_sides;

typedef struct like_outline {
    like_sides limb[MODEL_MAX_LIMBS];
} like_outline;

/* What the half of a limb that is turned to the camera looks like. */
typedef struct like_patch {
    uint8_t turn;            /* its first direction; modulo LIKE_DIRECTIONS */
    int8_t value[LIKE_HALF]; /* or TEXTURE_HIDDEN; as the surface points from 2 turn on */
} like_patch;

/* Costs of differences between surface samples, with LIKE_COUNT_ONE in each; and without it their bytes, of which a
 * register holds many. */
typedef struct like_costs {
    int32_t one[LIKE_COSTS];
    uint8_t low[LIKE_COSTS], high[LIKE_COSTS];
} like_costs;

typedef struct like_setup { /* constant while a tracker lives */
    const kernels *run;
    int32_t limbs;
    bool paper;     /* literal eqs. 10-13 */
    uint32_t terms; /* GAIT_TERM_* */
    float weight[LIKE_TERMS];
    float missed_weight;
    limb_geometry geometry[MODEL_MAX_LIMBS];
    like_surface surface[MODEL_MAX_LIMBS];
    like_costs robust; /* Student-t cost, LIKE_COST_ONE = 1 nat */
    like_costs square; /* the difference squared */
} like_setup;

/* What the terms say of a block's bodies. */
typedef struct like_block {
    int32_t cost[MODEL_MAX_LIMBS][BLOCK]; /* by limb: its surface and its ancestor's */
    float nats[LIKE_TERMS][BLOCK];        /* weighted; those in use */
} like_block;

typedef struct like_body { /* one body in one camera, as the terms see it */
    const like_setup *setup;
    const features *features;
    const outline_block *outline;
    const like_outline *sides; /* of the outline */
    int32_t lane;
    const layers *layers;
    const like_patch *samples;  /* by limb: its surface in this frame */
    const like_patch *ancestor; /* the same of its ancestor in the previous frame, or NULL */
    const gait_camera *camera;
    const float (*points)[3][BLOCK]; /* joints in the world, metres; read if the features have tracks */
    like_block *terms;               /* its block's */
    const int8_t *known;             /* limbs x LIKE_RING: running appearance (like_template.h), or NULL */
    int32_t area,
        covered; /* cells of the body that the camera sees, and the foreground in them; FOREGROUND_ONE = 1 */
} like_body;

typedef struct like_edge_tally {
    int32_t response; /* sum of n'Tn over the visible points, 128 x EDGE_ONE at most each */
    int32_t chance;   /* the same for a normal of random direction: half the trace */
    int32_t points;
} like_edge_tally;

typedef struct like_term {
    const char *name;
    uint32_t flag;                               /* GAIT_TERM_* */
    float (*log_likelihood)(const like_body *b); /* nats, without its weight */
    float (*support)(const like_body *b);        /* the same over "nobody is there"; NULL: no opinion */
} like_term;

extern const like_term like_texture, like_silhouette, like_edges, like_template, like_keypoints;

/* Look up the surface of every limb of one lane in the frame. */
static inline void like_sample(const like_setup *s, const features *f, const like_pose *pose, int32_t lane,
                               const layers *drawn, like_patch *out)
{
    s->run->surface_sample(s, f, pose, lane, drawn, out);
}

/* Edges along the visible outline, of [0, 1]; chance: what a line of any direction would meet there. */
float like_edges_along(const like_body *b, float *chance);

/* Count area and covered, which the silhouette's term reads. */
void like_silhouette_count(like_body *b);

/* The foreground that the body explains and that it leaves over, in nats of missed foreground; nothing without
 * a plate. */
typedef struct like_parts {
    float explained, missed;
} like_parts;

like_parts like_silhouette_parts(const like_body *b);
#endif
