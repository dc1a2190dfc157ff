/* snapshot.h - save, restore and hash the mutable state of a tracker. */
#ifndef GAIT_TRACKER_SNAPSHOT_H
#define GAIT_TRACKER_SNAPSHOT_H
#include "tracker/tracker_state.h"

size_t snapshot_bytes(const gait_tracker *t);
void snapshot_save(const gait_tracker *t, void *mem);
gait_result snapshot_restore(gait_tracker *t, const void *mem, size_t bytes, gait_error *err);
uint64_t snapshot_digest(const gait_tracker *t);
#endif
