/* blobs.h - person-sized regions in which an image differs from the empty scene. */
#ifndef GAIT_START_BLOBS_H
#define GAIT_START_BLOBS_H
#include "base/arena.h"
#include "gait_start.h"

typedef struct blob_finder {
    int32_t step, width, height; /* pixels per cell; cells, at most 320 in each direction */
    int16_t *change;             /* largest change of a channel, grey levels */
    int16_t *smooth;             /* mean over neighbours, quarters of a grey level */
    uint8_t *mask;               /* 1: differs, 2: also belongs to a region already examined */
    int32_t *queue;
} blob_finder;

/* Take the memory for images of this size. */
blob_finder blob_finder_layout(arena *a, int32_t width, int32_t height);

/* Whether half of an image differs from the background.  Both have the finder's size. */
bool blob_other_scene(const blob_finder *f, const gait_image *image, const gait_image *background);

/* The largest regions first, at most `capacity`; returns how many. */
int32_t blob_find(const blob_finder *f, const gait_image *image, const gait_image *background, gait_box *out,
                  int32_t capacity);
#endif
