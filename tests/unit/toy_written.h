/* toy_written.h - a new temporary file, whose name ends in XXXXXX before, with the given content. */
#ifndef TOY_WRITTEN_H
#define TOY_WRITTEN_H

#include <stdlib.h>
#include <unistd.h>

static inline void toy_written(char *name, const void *data, size_t bytes)
{
    int const file = mkstemp(name);
    if (file < 0 || write(file, data, bytes) != (ssize_t)bytes)
        abort();
    close(file);
}

#endif
