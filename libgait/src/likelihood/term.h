/* term.h - the interface of a likelihood term: its view of one body in one camera, and the terms that exist.
 *
 * Each term is an average (per limb, per area, per outline) times a weight in nats, so that pixels that are
 * not independent do not count as if they were (as in Ormoneit et al. 2000, eq. 11). */
#ifndef GAIT_LIKELIHOOD_TERM_H
#define GAIT_LIKELIHOOD_TERM_H
#include "image/features.h"
#include "base/dispatch.h"
#include "raster/layers.h"

/* The terms, in the order of their GAIT_TERM_* bits. */
enum { LIKE_TEXTURE, LIKE_SILHOUETTE, LIKE_EDGES, LIKE_TEMPLATE, LIKE_KEYPOINTS, LIKE_TERMS };

enum {
    LIKE_ROWS = 4,
    LIKE_AZIMUTHS = 8,
    LIKE_SAMPLES = LIKE_ROWS * LIKE_AZIMUTHS, /* surface points of a limb */
    LIKE_DIRECTIONS =
        2 * LIKE_AZIMUTHS,        /* of normals; rings are staggered by half a step: two points share each */
    LIKE_HALF = LIKE_SAMPLES / 2, /* surface points on the half of a limb that faces the camera */
    LIKE_RING = LIKE_SAMPLES + LIKE_HALF, /* once around and half again, so that every half is contiguous */
    LIKE_COSTS = 256,                     /* entries of a cost table */
    LIKE_COST_NONE = LIKE_COSTS - 1, /* of a pair of samples that are not both visible: no cost, no count */
    LIKE_COST_ONE = 256,             /* 1 nat in the robust cost table */
    LIKE_COUNT_ONE = 1 << 24 /* added to every entry, so that a sum of costs also contains their number */
};

/* Parts of the body.  A detector confuses left and right of the legs and of the arms independently. */
enum { LIKE_MIDDLE, LIKE_LEGS, LIKE_ARMS, LIKE_PARTS };

/* Whether a point of an outline is visible is read at this share of the way to the limb's middle. */
#define LIKE_INWARD 0.3f

/* Surface points of one limb, statures, the same for every particle. The normals of points 2 d and 2 d + 1 have
 * direction d; direction d + LIKE_AZIMUTHS is the opposite one. */
typedef struct like_surface {
    float point[3][LIKE_RING];
    float normal[3][LIKE_RING];
    float outward[LIKE_RING];     /* normal times point */
    float middle[3];              /* middle of the limb's axis */
    float side[3][LIKE_AZIMUTHS]; /* normals of the first half of the directions */
} like_surface;

/* Numbers of one limb of one body, one cache line: of its view, and of the sides of its outline (in one part
 * for a cone). */
enum {
    LIKE_WORDS = 16,
    LIKE_SUBPIXELS = 256, /* per working pixel, in each direction */
    LIKE_CELL_BITS = 9    /* log2 of the subpixels in a cell of the grid, which is two pixels wide */
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

/* A limb of BLOCK bodies: image (3 x 3), shift (3), origin (3), graze. A surface point p projects to (x, y)
 * = (image[0] p + shift[0], image[1] p + shift[1]) / (image[2] p + shift[2]), 1/256 working pixels. Its
 * normal n faces the camera if n origin + n p < graze, where origin is the vector from the camera to the
 * frame's origin, in the frame, statures. */
typedef struct like_pose_limb {
    float view[BLOCK][LIKE_WORDS];
    int32_t turn[BLOCK]; /* first of the LIKE_AZIMUTHS directions that can face the camera */
} like_pose_limb;

typedef struct like_pose {
    like_pose_limb limb[MODEL_MAX_LIMBS];
} like_pose;

/* Sides of a limb's outline in BLOCK bodies, stored body by body so that each body reads few cache lines:
 * their start points and vectors (x, y, dx, dy), working pixels; the double-angle form of their normals,
 * cos2 + 2^16 sin2 in whole numbers, 64 = 1, cos2 modulo 2^16; LIKE_INWARD times the limb's middle (inner_x,
 * inner_y), cells. */
typedef struct like_sides {
    float part[3][BLOCK][LIKE_WORDS];
} like_sides;

typedef struct like_outline {
    like_sides limb[MODEL_MAX_LIMBS];
} like_outline;

/* Surface samples of the half of a limb that faces the camera. */
typedef struct like_patch {
    uint8_t turn; /* first direction of the half; modulo LIKE_DIRECTIONS */
    /* samples in the order of the surface points from 2 turn on; TEXTURE_HIDDEN if not visible */
    int8_t value[LIKE_HALF];
} like_patch;

/* Costs of differences between surface samples: with LIKE_COUNT_ONE added to all but that of LIKE_COST_NONE,
 * and without it as two bytes, of which a register holds many. */
typedef struct like_costs {
    int32_t one[LIKE_COSTS];
    uint8_t low[LIKE_COSTS], high[LIKE_COSTS];
} like_costs;

typedef struct like_setup { /* constant while a tracker lives */
    const kernels *run;
    int32_t limbs;
    bool paper;  /* use eqs. 10-13 literally */
    int32_t few; /* a limb with fewer points that are visible in both frames counts as occluded */
    float all;   /* one with so many counts as fully visible */
    float log_occluded;
    float surface_var, tilt; /* eq. 11: of the difference of two frames; grey levels squared */
    uint32_t terms;          /* GAIT_TERM_* */
    float weight[LIKE_TERMS];
    float missed_weight;
    uint8_t part[GAIT_MAX_JOINTS];     /* of each joint: LIKE_MIDDLE, LIKE_LEGS or LIKE_ARMS */
    uint8_t opposite[GAIT_MAX_JOINTS]; /* the joint of the other side, or itself */
    limb_geometry geometry[MODEL_MAX_LIMBS];
    like_costs robust;                     /* Student-t cost, LIKE_COST_ONE = 1 nat */
    like_costs square;                     /* the difference squared */
    like_surface surface[MODEL_MAX_LIMBS]; /* a tracker stores as many as the model has */
} like_setup;

/* Values of the terms for the bodies of a block. */
typedef struct like_block {
    int32_t cost[MODEL_MAX_LIMBS][BLOCK]; /* by limb: cost between its surface and its ancestor's */
    float nats[LIKE_TERMS][BLOCK];        /* weighted log likelihoods; 0 for terms that are off */
} like_block;

typedef struct like_body { /* the inputs of a term: one body in one camera */
    const like_setup *setup;
    const features *features;
    const outline_block *outline;
    const like_outline *sides; /* sides of the outline */
    int32_t lane;
    const layers *layers;
    const like_patch *samples;  /* by limb: its surface in this frame */
    const like_patch *ancestor; /* surface of its ancestor in the previous frame, or NULL */
    const gait_camera *camera;
    const float (*points)[3][BLOCK]; /* joints, metres, world; for the keypoint term */
    like_block *terms;               /* values of its block */
    const int8_t *known;   /* limbs x LIKE_RING: running appearance (likelihood/template.h), or NULL */
    int32_t area, covered; /* of the body in the image; its foreground; a cell is FOREGROUND_ONE */
} like_body;

typedef struct like_edge_tally {
    int32_t response; /* sum of n'Tn over the visible points, at most 128 x EDGE_ONE each */
    int32_t chance;   /* the same for a normal of random direction: half the trace */
    int32_t points;
} like_edge_tally;

typedef struct like_term {
    uint32_t flag;                               /* GAIT_TERM_* */
    float (*log_likelihood)(const like_body *b); /* nats, without its weight */
    float (*support)(const like_body *b);        /* log likelihood ratio against no person; NULL: none */
} like_term;

extern const like_term like_texture, like_silhouette, like_edges, like_template, like_keypoints;

/* Edges along the visible outline, in [0, 1]; chance: the same for a line of random direction. */
float like_edges_along(const like_body *b, float *chance);

/* Compute area and covered, which the silhouette term reads. */
void like_silhouette_count(like_body *b);

/* The foreground that the body explains and the foreground that it misses, in nats of missed foreground; 0
 * without a background plate. */
typedef struct like_parts {
    float explained, missed;
} like_parts;

like_parts like_silhouette_parts(const like_body *b);
/* What a body of this area explains by chance, given the foreground outside of it. */
float like_silhouette_chance(const like_body *b);
#endif
