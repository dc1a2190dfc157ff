/* people.h - boxes of several people, matched to people by their place in the image, and the hypotheses of all people. */
#ifndef GAIT_START_PEOPLE_H
#define GAIT_START_PEOPLE_H
#include "base/base.h"
#include "gait_start.h"

#define START_KEEP 1500000 /* microseconds after which an observation is forgotten */

typedef struct start_view { /* where the camera was */
    float R[9], t[3];
} start_view;

typedef struct start_box { /* ideal pixels */
    double foot[2], head[2], sd;
    start_view view;
} start_box;

typedef struct start_person {
    int32_t count; /* boxes, of which the last GAIT_START_MAX_FRAMES are kept */
    int64_t utime[GAIT_START_MAX_FRAMES];
    start_box box[GAIT_START_MAX_FRAMES];
} start_person;

typedef struct start_people {
    int64_t utime; /* of the last frame */
    bool begun;    /* there is one */
    start_person person[GAIT_START_MAX_PEOPLE];
} start_people;

static inline double people_distance(const double a[2], const double b[2])
{
    double const u = a[0] - b[0], v = a[1] - b[1];
    return sqrt(u * u + v * v);
}

start_view start_view_of(const gait_camera *c);

/* Undo the distortion; false: its numbers are not finite, or sd is negative. */
bool people_box(const gait_camera *c, const gait_box *in, start_box *out);

/* Stature of the person in a box, metres; NAN: the ray of the foot meets no floor. */
double people_stature(const gait_camera *c, const start_box *b);

/* Boxes of a frame, the most certain first. */
void people_add(start_people *p, const gait_camera *c, int64_t utime, const gait_box *boxes, int32_t count);

/* Merge the hypotheses of one person, who is in `frames` frames, into the n hypotheses of other people: at most
 * GAIT_START_MAX_HYPOTHESES, the most probable first; returns how many there are.  People who walk, or are in more frames,
 * are more probable. */
int32_t people_merge(gait_hypothesis *all, int32_t n, gait_hypothesis *own, int32_t count, int32_t frames);

/* Make the probabilities sum to 1; returns n. */
int32_t people_normalise(gait_hypothesis *all, int32_t n);
#endif
