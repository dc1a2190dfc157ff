/* stream_estimate.h - a frame of the past by the segments that cover it. */
#ifndef GAIT_LIFT_STREAM_ESTIMATE_H
#define GAIT_LIFT_STREAM_ESTIMATE_H
#include "lift/stream.h"

/* The frame `lag` frames before the last, or the earliest that is still covered. false: not so many frames
 * yet. */
bool lift_estimate(const lift_table *t, const lift_stream *s, gait_lift_frame *out);
#endif
