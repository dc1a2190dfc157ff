/* link.h - the LCM connections of a program. */
#ifndef TOOLS_LINK_H
#define TOOLS_LINK_H
#include "message.h"

#include <lcm/lcm.h>

/* Room for the receiver is part of the URL: with the system's default a 640x480 colour stream loses 9 of 10. */
#define LINK_DEFAULT_URL "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304"

/* `url` if given, else LCM_DEFAULT_URL of the environment, else LINK_DEFAULT_URL. */
const char *link_url(const char *url);
/* Open; NULL with the remedy in `why`. */
lcm_t *link_open(const char *url, message *why);
/* Subscribe with room for `capacity` waiting messages; NULL with the remedy in `why`. */
lcm_subscription_t *link_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t fn, void *user,
                                   int capacity, message *why);
/* A log that is played, in which nothing can be lost. */
bool link_is_log(const char *url);
#endif
