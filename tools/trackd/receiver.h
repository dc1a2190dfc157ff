/* receiver.h - carries messages from LCM to the service. */
#ifndef TRACKD_RECEIVER_H
#define TRACKD_RECEIVER_H
#include "service.h"
#include "snapshot_file.h"

#include <signal.h>

/* Live, images have a separate connection, of which only the newest frame is used, so that commands never wait behind
 * images.  A log is one connection, played in order and without loss. */
typedef struct receiver {
    service *service;
    lcm_t *images, *others; /* the same for a log */
    lcm_subscription_t *frames;
    bool log;
    snapshot_file *snapshot;
} receiver;

/* Connect to `url` and subscribe. */
bool receiver_open(receiver *r, service *s, snapshot_file *snapshot, const char *url, message *why);
void receiver_close(receiver *r);
/* Serve until *quit is set by a signal, or the log ends.  Signals must be blocked; `unblocked` is the mask to wait
 * with. */
bool receiver_run(receiver *r, const volatile sig_atomic_t *quit, const sigset_t *unblocked, message *why);
#endif
