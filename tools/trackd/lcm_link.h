/* lcm_link.h - LCM connections, the output to LCM or a log, and the check that a log is complete. */
#ifndef TRACKD_LCM_LINK_H
#define TRACKD_LCM_LINK_H
#include "common.h"

#include <lcm/eventlog.h>
#include <lcm/lcm.h>
#include <stdint.h>

/* ---- is an LCM log whole? */
/* Number of whole messages up to where the log ends or breaks off, -1 for what is no regular file; `why` says that it is
 * empty or breaks off, or nothing. */
int64_t log_scan(const char *path, message *why);

/* ---- the LCM connections of a program. */
enum { LINK_PATH = 1024 }; /* bytes of a log's name, with its end */

/* Room for the receiver is part of the URL: with the system's default a 640x480 colour stream loses 9 of 10. */
#define LINK_DEFAULT_URL "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304"

/* `url` if given, else LCM_DEFAULT_URL of the environment, else LINK_DEFAULT_URL. */
const char *link_url(const char *url);
/* Open; NULL with the remedy in `why`. */
lcm_t *link_open(const char *url, message *why);
/* Subscribe with room for `capacity` waiting messages; NULL with the remedy in `why`. */
lcm_subscription_t *link_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t fn, void *user,
                                   int capacity, message *why);
/* A log, which is played without loss, or written. */
bool link_is_log(const char *url);
/* Its name, and its mode: 'r', 'w' or 'a', 0 where ?mode= says anything else. */
char link_log(const char *url, char path[LINK_PATH]);

/* ---- where a program publishes: LCM, or a log whose writing is watched (LCM's own log provider does not tell). */
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
