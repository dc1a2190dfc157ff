/* snapshot_file.h - the trackers' states in a file, from which the next daemon continues. */
#ifndef TRACKD_SNAPSHOT_FILE_H
#define TRACKD_SNAPSHOT_FILE_H
#include "service.h"

#include <sys/stat.h>

typedef struct snapshot_file { /* all zero: not requested */
    const char *path;          /* NULL also after another program has replaced the file */
    int64_t period;            /* microseconds between two snapshots */
    int64_t due;               /* monotonic time of the next one */
    bool failed;               /* writing has been reported as failed */
    bool own;                  /* the file is what was resumed or written */
    struct stat written;       /* the file after the last snapshot; st_ino 0: none yet */
} snapshot_file;

/* Check before the start that the file can be written, and that it is a snapshot or not there. */
bool snapshot_file_check(const snapshot_file *f, message *why);
/* Continue with the people, by their numbers, and the camera of the file.  If the file is for another model,
 * configuration, camera or stream number, the service starts without it and prints the reason to stderr. */
void snapshot_file_resume(snapshot_file *f, service *s);
/* Replace the file if a snapshot is due or if `at_once`; the file is never incomplete, and is removed, if it is our own,
 * while no person is tracked.  A failure is reported once, and so is another program that writes the same file: then
 * only that one does. */
void snapshot_file_write(snapshot_file *f, const service *s, bool at_once);
#endif
