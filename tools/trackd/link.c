#include "link.h"

#include "log_scan.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define ROUTE_REMEDY "if this machine has no multicast route: ip route add 224.0.0.0/4 dev lo (as root)"

/* liblcm writes pages about a missing route to stderr; one line of ours says as much. */
static int mute(void)
{
    fflush(stderr);
    int const saved = dup(STDERR_FILENO), null = open("/dev/null", O_WRONLY);
    if (saved >= 0 && null >= 0)
        dup2(null, STDERR_FILENO);
    if (null >= 0)
        close(null);
    return saved;
}

static void unmute(int saved)
{
    if (saved < 0)
        return;
    fflush(stderr);
    dup2(saved, STDERR_FILENO);
    close(saved);
}

const char *link_url(const char *url)
{
    const char *const environment = getenv("LCM_DEFAULT_URL");
    if (url && *url)
        return url;
    return environment && *environment ? environment : LINK_DEFAULT_URL;
}

bool link_is_log(const char *url)
{
    return strncmp(url, "file://", 7) == 0;
}

char link_log(const char *url, char path[LINK_PATH])
{
    const char *const name = url + (link_is_log(url) ? 7 : 0), *at = strchr(name, '?');
    char mode = 'r';
    snprintf(path, LINK_PATH, "%.*s", at ? (int)(at - name) : LINK_PATH - 1, name);
    for (; at; at = strchr(at + 1, '&'))
        if (strncmp(at + 1, "mode=", 5) == 0)
            mode = at[6] && strchr("rwa", at[6]) && (at[7] == '\0' || at[7] == '&') ? at[6] : 0;
    return mode;
}

/* The address of udpm://ADDRESS:PORT, if it is one that LCM cannot send to. */
static bool not_multicast(const char *url, char address[INET_ADDRSTRLEN])
{
    struct in_addr in;
    size_t const length = strncmp(url, "udpm://", 7) == 0 ? strcspn(url + 7, ":?") : 0;
    if (length == 0 || length >= INET_ADDRSTRLEN)
        return false;
    snprintf(address, INET_ADDRSTRLEN, "%.*s", (int)length, url + 7);
    return inet_pton(AF_INET, address, &in) == 1 && !IN_MULTICAST(ntohl(in.s_addr));
}

lcm_t *link_open(const char *url, message *why)
{
    char path[LINK_PATH], address[INET_ADDRSTRLEN];
    int const saved = mute();
    lcm_t *const lcm = lcm_create(url);
    unmute(saved);
    link_log(url, path);
    if (!lcm && link_is_log(url) && log_scan(path, why) != 0)
        message_set(why, "%.160s: cannot open this log; give file:///PATH?speed=0", url);
    else if (!lcm && not_multicast(url, address))
        message_set(why, "%.100s: %s is not a multicast address; give one from 224.0.0.0 to 239.255.255.255",
                    url, address);
    else if (!lcm && !link_is_log(url) && strstr(url, "udpm://")) /* or mpudpm:// */
        message_set(why, "%.120s: cannot open LCM; " ROUTE_REMEDY, url);
    else if (!lcm && !link_is_log(url))
        message_set(
            why,
            "%.120s: cannot open LCM; give udpm://ADDRESS:PORT or file:///PATH?speed=0 (?mode=w to write)",
            url);
    return lcm;
}

lcm_subscription_t *link_subscribe(lcm_t *lcm, const char *channel, lcm_msg_handler_t fn, void *user,
                                   int capacity, message *why)
{
    int const saved = mute();
    lcm_subscription_t *const s = lcm_subscribe(lcm, channel, fn, user);
    unmute(saved);
    if (s)
        lcm_subscription_set_queue_capacity(s, capacity);
    else
        message_set(why, "cannot receive %s; " ROUTE_REMEDY, channel);
    return s;
}
