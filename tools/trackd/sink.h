/* sink.h - where a program publishes: LCM, or a log whose writing is watched (LCM's own log provider does not tell). */
#ifndef TRACKD_SINK_H
#define TRACKD_SINK_H
#include "message.h"

#include <lcm/eventlog.h>
#include <lcm/lcm.h>

typedef struct sink {    /* all zero: nowhere */
    lcm_t *lcm;          /* or NULL */
    lcm_eventlog_t *log; /* or NULL */
    int64_t failed;      /* messages that did not go out */
    message fault;       /* of the first of them */
} sink;

/* Open `url`, a log with ?mode=w (new) or a (at its end); false with the remedy in `why`. */
bool sink_open(sink *s, const char *url, message *why);
/* Publish `size` bytes; that LCM refuses one is said once on stderr, and into a log nothing follows a failure. */
void sink_publish(sink *s, const char *channel, const uint8_t *bytes, int size);
/* Has writing of the log failed, so that there is no use in going on? */
bool sink_ended(const sink *s, message *why);
/* Flush and close; false if anything was lost. */
bool sink_close(sink *s, message *why);
#endif
