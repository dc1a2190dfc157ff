#include "sink.h"

#include "link.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

bool sink_open(sink *s, const char *url, message *why)
{
    char path[LINK_PATH];
    char const mode[2] = {link_log(url, path)};
    *s = (sink){0};
    if (!link_is_log(url))
        return (s->lcm = link_open(url, why)) != NULL;
    s->log = lcm_eventlog_create(path, mode);
    return s->log || message_set(why, "%.160s: this log cannot be written: %s", path, strerror(errno));
}

static void lost(sink *s, const char *what)
{
    if (s->failed++ == 0)
        message_set(&s->fault, "%s", what);
}

/* As LCM's log provider writes it, dated now. */
static bool write_event(lcm_eventlog_t *log, const char *channel, const uint8_t *bytes, int size)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    lcm_eventlog_event_t e = {.timestamp = (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000,
                              .channellen = (int32_t)strlen(channel),
                              .datalen = size,
                              .channel = (char *)channel, /* LCM lacks const; read only */
                              .data = (void *)bytes};
    return lcm_eventlog_write_event(log, &e) == 0 && !ferror(log->f);
}

void sink_publish(sink *s, const char *channel, const uint8_t *bytes, int size)
{
    if (size <= 0)
        return;
    if (s->lcm && lcm_publish(s->lcm, channel, bytes, (unsigned)size) != 0) {
        lost(s, "LCM could not send them");
        if (s->failed == 1)
            fprintf(stderr, "gait-trackd: LCM could not send a message of %d bytes on %s\n", size, channel);
    }
    errno = 0;
    if (s->log && (s->failed || !write_event(s->log, channel, bytes, size)))
        lost(s, strerror(errno));
}

bool sink_ended(const sink *s, message *why)
{
    return s->log && s->failed &&
           !message_set(why, "--out: the log cannot be written: %.180s", s->fault.text);
}

bool sink_close(sink *s, message *why)
{
    if (s->lcm)
        lcm_destroy(s->lcm);
    if (s->log && fflush(s->log->f) != 0 && !s->failed)
        lost(s, strerror(errno));
    bool const ok = s->failed == 0 ||
                    message_set(why, "--out: %s %.180s",
                                s->log ? "the log cannot be written:" : "messages were lost:", s->fault.text);
    if (s->log)
        lcm_eventlog_destroy(s->log);
    *s = (sink){0};
    return ok;
}
