#include "file.h"

#include "gait.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Far above any model, camera or picture; stops a device or a wrong file from filling the memory. */
enum { MAX_FILE = 1 << 28 };

static bool read_stream(FILE *f, const char *path, const char *what, file_bytes *out, message *why)
{
    long size = -1;
    if (fseek(f, 0, SEEK_END) == 0)
        size = ftell(f);
    if (size < 0 || size > MAX_FILE || fseek(f, 0, SEEK_SET) != 0)
        return message_set(
            why, "%s: no %s file, as it is no regular file of reasonable size; give the name of one", path,
            what);
    size_t const room = ((size_t)size + 1 + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN;
    out->data = aligned_alloc(GAIT_ALIGN, room);
    if (!out->data)
        return message_set(why, "%s: not enough memory for %ld bytes", path, size);
    out->size = fread(out->data, 1, (size_t)size, f);
    memset(out->data + out->size, 0, room - out->size);
    if (out->size == (size_t)size)
        return true;
    free(out->data);
    *out = (file_bytes){0};
    return message_set(why, "%s: cannot be read to its end", path);
}

bool file_read(const char *path, const char *what, file_bytes *out, message *why)
{
    *out = (file_bytes){0};
    FILE *const f = fopen(path, "rb");
    if (!f)
        return message_set(why, "%s: cannot open the %s file: %s", path, what, strerror(errno));
    bool const ok = read_stream(f, path, what, out, why);
    fclose(f);
    return ok;
}
