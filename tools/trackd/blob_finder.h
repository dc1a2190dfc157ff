/* blob_finder.h - the largest person-sized patch in which a picture differs from the empty scene. */
#ifndef TRACKD_BLOB_FINDER_H
#define TRACKD_BLOB_FINDER_H
#include "gait.h"

#include <stdbool.h>

enum { BLOB_CELLS = 320 * 320 }; /* a picture is looked at in at most so many cells */

typedef struct blob_finder {
    int32_t step, width, height; /* pixels a cell; cells */
    int16_t change[BLOB_CELLS];  /* largest change of a channel, grey levels */
    int16_t smooth[BLOB_CELLS];
    uint8_t mask[BLOB_CELLS]; /* 1: differs, 2: also belongs to a patch that was looked at */
    int32_t queue[BLOB_CELLS];
} blob_finder;

typedef struct blob {        /* pixels */
    double foot[2], head[2]; /* lowest and highest point on the middle line */
    int32_t area;            /* cells */
} blob;

/* Does half of a picture differ from the empty scene, so that it shows another one?  Both have the same size. */
bool blob_another_scene(blob_finder *f, const gait_image *image, const gait_image *plate);

/* Both pictures have the same size.  False: nobody stands in full view. */
bool blob_find(blob_finder *f, const gait_image *image, const gait_image *plate, blob *out);
#endif
