/* fuzz_log.c - a damaged log is refused, or else liblcm reads it without taking more memory than the file has. */
#define _GNU_SOURCE /* memfd_create */
#include "../../tools/trackd/lcm_link.c"

#include "daemon.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static memory_file file;
    message why;
    if (!file.path[0])
        file = memory_file_make();
    memory_file_write(&file, data, size);
    bool safe;
    int64_t const events = scan(file.path, &safe, &why);
    if (events < 0 || (events == 0 && !why.text[0]))
        abort();
    bool const damaged = why.text[0] != '\0';
    if (!safe)
        return 0;
    lcm_eventlog_t *const log = lcm_eventlog_create(file.path, "r");
    int64_t read = 0;
    for (lcm_eventlog_event_t *e; log && (e = lcm_eventlog_read_next_event(log)); read++) {
        if (e->datalen < 0 || (size_t)e->datalen > size)
            abort();
        lcm_eventlog_free_event(e);
    }
    if (read + damaged < events) /* liblcm drops an event that is followed by garbage */
        abort();
    lcm_eventlog_destroy(log);
    return 0;
}
