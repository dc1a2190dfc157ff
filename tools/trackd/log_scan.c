#include "log_scan.h"

#include <inttypes.h>
#include <stdio.h>
#include <sys/stat.h>

enum {
    HEAD = 28,                       /* bytes before the channel's name, */
    SYNC = 0xEDA1DA01 - (1LL << 32), /* the first four of them */
    LONGEST = 1000                   /* bytes of a name at which LCM stops */
};

static int64_t big_endian(const unsigned char *at)
{
    return (int32_t)((uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3]);
}

/* Bytes of the event at the file's place; 0 where none begins there. */
static int64_t event_bytes(FILE *f)
{
    unsigned char head[HEAD];
    if (fread(head, 1, HEAD, f) != HEAD || big_endian(head) != SYNC)
        return 0;
    int64_t const name = big_endian(head + 20), data = big_endian(head + 24);
    return name <= 0 || name >= LONGEST || data < 0 ? 0 : HEAD + name + data;
}

int64_t log_scan(const char *path, message *why)
{
    struct stat is;
    int64_t at = 0, events = 0, size = 0;
    FILE *const f = fopen(path, "rb");
    why->text[0] = '\0';
    if (!f || fstat(fileno(f), &is) != 0 || !S_ISREG(is.st_mode)) {
        if (f)
            fclose(f);
        return -1;
    }
    while (at < is.st_size && (size = event_bytes(f)) > 0 && at + size <= is.st_size) {
        at += size;
        events++;
        fseeko(f, (off_t)at, SEEK_SET);
    }
    fclose(f);
    if (is.st_size == 0)
        message_set(why, "%.160s: this log is empty", path);
    else if (at != is.st_size)
        message_set(
            why, "%.150s: this log is damaged or breaks off at byte %" PRId64 ", after %" PRId64 " messages",
            path, at, events);
    return events;
}
