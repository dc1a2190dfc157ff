/* features.h - feature extraction: the maps that the likelihood terms read, computed once per frame inside
 * one camera's region. */
#ifndef GAIT_IMAGE_FEATURES_H
#define GAIT_IMAGE_FEATURES_H
#include "base/dispatch.h"
#include "base/grid_mask.h"
#include "image/view.h"

enum {
    FOREGROUND_PLANES = 4, /* bits of a cell's foreground probability */
    FOREGROUND_ONE = 15,   /* probability 1 */
    EDGE_ONE = 120,        /* edge tensor of trace 1 */
    CONTRAST_UNIT = 32,    /* one local standard deviation */
    TEXTURE_HIDDEN = -128  /* marks a surface sample that is not visible */
};

typedef struct
    edge_cell { /* smoothed, contrast-normalised edge tensor T; n'Tn is the response to a normal n */
    int8_t trace, xx_yy, zero, xy2;
} edge_cell;

typedef struct features_keypoints {               /* joints that a detector found in the frame */
    int32_t count;                                /* number of joints found; 0: the keypoint term is 0 */
    float u[GAIT_MAX_JOINTS], v[GAIT_MAX_JOINTS]; /* pixels without the lens's distortion */
    float inverse_sd[GAIT_MAX_JOINTS];            /* 0: not found */
} features_keypoints;

typedef struct features {
    view_map map;
    bool has_image;      /* this frame had an image */
    bool has_foreground; /* and a background plate */
    edge_cell *edge;     /* VIEW_PIXELS */
    uint16_t *pairs; /* VIEW_PIXELS: each value of the surface map, and in the high byte the one below it */
    int32_t foreground_total; /* sum of the foreground over the grid, FOREGROUND_ONE = 1 */
    uint64_t (*foreground)[GRID_SIZE][GRID_WORDS]; /* FOREGROUND_PLANES bit planes of the probability */
    uint64_t (*inside)[GRID_WORDS]; /* cells inside the camera's image that show no other person */
    view_map inside_map; /* region for which `inside` was computed; scale 0: without cells of other people */
    const gait_image *people; /* nearest person in each ideal pixel of this frame; NULL: not given */
    uint64_t person;          /* the tracked one */
    /* The planes of foreground, then inside, in words that begin at each multiple of GRID_STEP columns, as
     * grid_mask's. */
    uint64_t (*words)[FOREGROUND_PLANES + 1][GRID_SIZE]; /* GRID_STARTS */
    features_keypoints keypoints;
} features;

enum { EDGE_SIZE_ROWS = 32, EDGE_SMOOTH_ROWS = 4 }; /* rows of each ring: row y is at y modulo this */

typedef struct
    edge_rows { /* rings of rows of the edge tensor: gradient size, smoothed once, smoothed twice */
    uint16_t size[EDGE_SIZE_ROWS][VIEW_SIZE];
    int16_t once[3][EDGE_SMOOTH_ROWS][VIEW_SIZE], twice[3][EDGE_SMOOTH_ROWS][VIEW_SIZE];
} edge_rows;

typedef struct features_scratch { /* shared by the cameras */
    view_planes planes;
    uint8_t *grey;   /* VIEW_PIXELS */
    int8_t *surface; /* VIEW_PIXELS: values of surface samples: local contrast, or grey - 128 in paper mode */
    edge_rows *rows;
} features_scratch;

features features_layout(arena *a);
features_scratch features_scratch_layout(arena *a);

/* Begin a frame in the region f->map, or a step without an image (im->data NULL); sets f->has_image. */
void features_begin(features *f, const gait_image *im, features_scratch *s);

/* Resample one of FEATURES_BANDS parts of the frame's planes and grey levels. Parts may run in parallel. */
enum { FEATURES_BANDS = 4 };
void features_sample(const kernels *run, const features *f, int32_t band, const gait_camera *cam,
                     const gait_image *im, features_scratch *s);

/* Make `words` from foreground and inside. */
void features_words(features *f);

/* The maps, in order of decreasing time. They may run in parallel. */
enum { FEATURES_EDGES, FEATURES_SURFACE, FEATURES_FOREGROUND, FEATURES_MAPS };

/* Compute one of the maps. plate: the resampled background plate, with colour only if the frame has colour,
 * or NULL. raw: the surface map has grey levels (paper mode). Kernels (base/dispatch.h):
 *
 *    features_foreground  foreground and foreground_total where inside
 *    features_edges       edge tensors of a grey plane
 *    features_contrast    local contrast of a grey plane
 *    features_pairs       each value of the surface map with the one below it */
void features_map(const kernels *run, features *f, int32_t map, const gait_camera *cam,
                  const view_planes *plate, bool raw, features_scratch *s);
#endif
