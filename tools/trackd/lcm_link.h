/* lcm_link.h - LCM connections, the output to LCM or a log, and the check that a log is complete. */
#ifndef TRACKD_LCM_LINK_H
#define TRACKD_LCM_LINK_H
#include "common.h"

#include <lcm/eventlog.h>
#include <lcm/lcm.h>
#include <stdint.h>

/* ---- whether an LCM log is complete. */
/* Number of complete messages, -1 if this is not a regular file.  `why` reports an empty or truncated log, or is empty. */
int64_t log_scan(const char *path, message *why);
/* ---- the LCM connections of a program. */
enum { LINK_PATH = 1024, LINK_CHANNEL = 40 }; /* bytes of a log's name, of a channel's, with their ends */

/* The channel of a person: for person 2 GAIT_ESTIMATE becomes GAIT_ESTIMATE_2, for person 0 it stays as it is. */
const char *link_channel(const char *channel, int person, char name[LINK_CHANNEL]);

/* The URL sets the receive buffer: with the system's default a 640x480 colour stream loses nine frames of ten. */
#define LINK_DEFAULT_URL "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304"

/* `url` if given, else LCM_DEFAULT_URL of the environment, else LINK_DEFAULT_URL. */
const char *link_url(const char *url);
/* Open; NULL with the remedy in `why`. */
lcm_t *link_open(const char *url, message *why);
/* Subscribe with a queue of `capacity` messages; NULL with the remedy in `why`. */
lcm_subscription_t *link_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t fn, void *user,
                                   int capacity, message *why);
/* Whether this is a log, to be played or written. */
bool link_is_log(const char *url);
/* Path of a log, and its mode: 'r', 'w' or 'a', 0 if ?mode= is anything else. */
char link_log(const char *url, char path[LINK_PATH]);
/* NAME.unfinished.SUFFIX beside a log, or beside what a link to it points to: a new log is written there until it is complete. */
void link_unfinished(const char *path, char beside[LINK_PATH]);

/* ---- output to LCM, or to a log with checked writes (LCM's own log provider does not report failures). */
typedef struct sink {       /* all zero: no output */
    lcm_t *lcm;             /* or NULL */
    lcm_eventlog_t *log;    /* or NULL */
    int lock, other;        /* with a log: descriptors that lock what is written and its other name, or -1 */
    char path[LINK_PATH];   /* of the log, not of a link to it */
    char beside[LINK_PATH]; /* of link_unfinished(); empty: a device or a pipe */
    bool fresh;             /* it is a new log */
    int64_t failed;         /* messages that did not go out */
    message fault;          /* of the first of them */
} sink;

/* Open `url`; a log has ?mode=w (new) or a (append), and no other writer.  What an earlier program left as NAME.unfinished.SUFFIX
 * is kept as NAME.unfinished-2.SUFFIX or the next free number, and reported. */
bool sink_open(sink *s, const char *url, message *why);
/* Whether `url` could be opened by a program that ends the use of `own`, the output in use; changes nothing, and does not
 * open a pipe. */
bool sink_check(const char *url, const sink *own, message *why);
/* Publish `size` bytes on the channel of a person, 0: of all.  The first failure of LCM is reported on stderr; after
 * a failure of a log nothing more is written. */
void sink_publish(sink *s, const char *channel, int person, const uint8_t *bytes, int size);
/* Whether writing the log has failed, so that the program should end. */
bool sink_ended(const sink *s, message *why);
/* Flush and close.  If the program has not failed (`ok`) and nothing was lost, a new log gets its name; otherwise the result is
 * false, and `why` also names the file with what was written. */
bool sink_close(sink *s, bool ok, message *why);
#endif
