/* daemon.h - for targets that call parts of gait-trackd: files that are only in memory, and nothing on stderr but reports
 * of the sanitizers. */
#ifndef FUZZ_DAEMON_H
#define FUZZ_DAEMON_H
#include "fuzz.h"

#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

typedef struct memory_file {
    int file;
    char path[32];
} memory_file;

static inline memory_file memory_file_make(void)
{
    memory_file m = {.file = memfd_create("fuzz", MFD_CLOEXEC)};
    snprintf(m.path, sizeof m.path, "/proc/self/fd/%d", m.file);
    if (m.file < 0 || !(stderr = fopen("/dev/null", "w")))
        abort();
    return m;
}

static inline void memory_file_write(const memory_file *m, const void *data, size_t size)
{
    if (ftruncate(m->file, 0) != 0 || pwrite(m->file, data, size, 0) != (ssize_t)size)
        abort();
}
#endif
