/* link.h - the LCM connections of a program. */
#ifndef TRACKD_LINK_H
#define TRACKD_LINK_H
#include "message.h"

#include <lcm/lcm.h>

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
#endif
