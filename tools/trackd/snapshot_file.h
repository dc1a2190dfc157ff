/* snapshot_file.h - the tracker's state in a file, from which the next daemon continues. */
#ifndef TRACKD_SNAPSHOT_FILE_H
#define TRACKD_SNAPSHOT_FILE_H
#include "service.h"

typedef struct snapshot_file { /* all zero: not requested */
    const char *path;
    int64_t period; /* microseconds between two snapshots */
    int64_t due;    /* monotonic time of the next one */
    bool failed;    /* writing has been reported as failed */
} snapshot_file;

/* Continue with the person and the camera of the file.  If it belongs to another model, configuration, camera or number of
 * the stream, the service starts as without it, and one line on stderr gives the reason. */
void snapshot_file_resume(const snapshot_file *f, service *s);
/* Replace the file if a snapshot is due, or at once: completely or not at all.  While no person is tracked there is no
 * file.  A failure is reported once. */
void snapshot_file_write(snapshot_file *f, const service *s, bool at_once);
#endif
