/* features.h - what the likelihood terms look up: maps computed once per frame inside one camera's region. */
#ifndef GAIT_FEATURES_H
#define GAIT_FEATURES_H
#include "rast.h"
#include "view.h"

enum {
    FG_PLANES = 4,        /* bits of a cell's foreground probability */
    FG_ONE = 15,          /* probability 1 */
    EDGE_ONE = 120,       /* edge tensor of trace 1 */
    CONTRAST_UNIT = 32,   /* one local standard deviation */
    TEXTURE_HIDDEN = -128 /* marks a surface sample that was not seen */
};

typedef struct edge_cell { /* smoothed, contrast-normalised edge tensor: n'Tn is the response to a normal n */
    int8_t trace, xx_yy, xy2, zero;
} edge_cell;

typedef struct features {
    view_map map;
    bool seen;        /* this frame had an image */
    bool has_fg;      /* and a background plate */
    edge_cell *edge;  /* VIEW_PIXELS */
    int8_t *surface;  /* VIEW_PIXELS: what surface samples see: local contrast, or grey - 128 in paper mode */
    int32_t fg_total; /* sum of foreground over the grid, FG_ONE = 1 */
    uint64_t (*fg)[RAST_SIZE][RAST_WORDS]; /* FG_PLANES bit planes of the foreground probability */
    uint64_t (*inside)[RAST_WORDS];        /* cells that the camera sees */
} features;

typedef struct features_scratch { /* shared by the cameras */
    view_planes planes;
    uint8_t *grey;      /* VIEW_PIXELS */
    int16_t *gx, *gy;   /* VIEW_PIXELS */
    int32_t *sum, *tmp; /* VIEW_PIXELS */
    int16_t *tensor;    /* 3 x VIEW_PIXELS */
} features_scratch;

features features_layout(arena *a);
features_scratch features_scratch_layout(arena *a);

/* All maps of one frame.  plate: resampled empty scene, with colour only if the frame has, or NULL; raw:
 * surface keeps grey levels (paper mode). */
void features_compute(features *f, const gait_camera *cam, const gait_image *im, const view_planes *plate,
                      bool raw, features_scratch *s);

/* The parts, for tests. */
void features_foreground(features *f, const view_planes *im, const view_planes *plate);
void features_edges(const uint8_t *grey, edge_cell *out, features_scratch *s);
void features_contrast(const uint8_t *grey, int8_t *out, features_scratch *s);

/* Sum over a (2 radius + 1)^2 box with replicated borders. */
void features_box(const int32_t *in, int32_t *out, int32_t radius, int32_t *tmp);
#endif
