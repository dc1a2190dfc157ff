/* folder.h - the folder of a file, and the names in it on the disk. */
#ifndef TRACKD_FOLDER_H
#define TRACKD_FOLDER_H
#include "options.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* Open the folder of a file; -1: it cannot be opened. */
static inline int folder_open(const char *path)
{
    char folder[OPTION_TEXT];
    const char *const slash = strrchr(path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - path + 1) : 1, slash ? path : ".");
    return open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

/* Why no file can be made in the folder of a file: 0 or an errno. */
static inline int folder_fault(const char *path)
{
    int const folder = folder_open(path);
    int const fault = folder < 0 || faccessat(folder, ".", W_OK | X_OK, AT_EACCESS) != 0 ? errno : 0;
    if (folder >= 0)
        close(folder);
    return fault;
}

/* Flush the names in the folder of a file to the disk; returns 0 or an errno.  Some file systems cannot, and need not. */
static inline int folder_flush(const char *path)
{
    int const folder = folder_open(path);
    int const fault = folder < 0 || (fsync(folder) != 0 && errno != EINVAL) ? errno : 0;
    if (folder >= 0)
        close(folder);
    return fault;
}
#endif
