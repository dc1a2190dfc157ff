/* toy_features.h - all features of a frame, one map after the other. */
#ifndef TOY_FEATURES_H
#define TOY_FEATURES_H
#include "image/features.h"

static inline void toy_features(const kernels *run, features *f, const gait_camera *cam, const gait_image *im,
                                const view_planes *plate, bool raw, features_scratch *s)
{
    features_begin(f, im, s);
    for (int32_t band = 0; band < FEATURES_BANDS; band++)
        features_sample(run, f, band, cam, im, s);
    for (int32_t map = 0; map < FEATURES_MAPS && f->has_image; map++)
        features_map(run, f, map, cam, plate, raw, s);
}
#endif
