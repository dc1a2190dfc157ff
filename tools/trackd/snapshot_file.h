/* snapshot_file.h - the trackers' states in a file, from which the next daemon continues. */
#ifndef TRACKD_SNAPSHOT_FILE_H
#define TRACKD_SNAPSHOT_FILE_H
#include "service.h"

#include <sys/stat.h>

/* Periods for which a file that another program has replaced must stay as it is. */
enum { SNAPSHOT_LEFT = 3 };

typedef struct snapshot_file { /* all zero: not requested */
    const char *path;
    int64_t period;   /* microseconds between two snapshots */
    int64_t due;      /* monotonic time of the next one */
    bool failed;      /* writing has been reported as failed */
    bool own;         /* the file is what was resumed or written */
    struct stat last; /* the file when it was read, written or looked at last; st_ino 0: there was none */
    int left;         /* periods until it is no longer left to another program */
} snapshot_file;

/* Check before the start that the file can be written, and that it is a snapshot or not there. */
bool snapshot_file_check(const snapshot_file *f, message *why);
/* Continue with the people, by their numbers, and the camera of the file.  If the file is for another model,
 * configuration, camera or stream number, the service starts without it and prints the reason to stderr. */
void snapshot_file_resume(snapshot_file *f, service *s);
/* Replace the file if a snapshot is due or if `at_once`; the file is never incomplete, and is removed, if it is our own,
 * while no person is tracked.  A failure is reported once.  If another program has replaced the file, that is a complaint,
 * and the file is left to that program until it has stayed as it is for SNAPSHOT_LEFT periods. */
void snapshot_file_write(snapshot_file *f, service *s, bool at_once);
#endif
