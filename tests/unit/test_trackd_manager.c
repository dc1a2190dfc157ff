/* Reports to a service manager: to a socket in the file system, to an abstract one, and to none. */
#define _XOPEN_SOURCE 700 /* P_tmpdir, setenv */
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static bool no_socket;

static int layer_socket(int domain, int type, int protocol)
{
    return no_socket ? -1 : socket(domain, type, protocol);
}

#define socket layer_socket
#include "../../tools/trackd/manager.c"
#undef socket

#include "check.h"

/* Listen there; '@' stands for the zero byte of an abstract name. */
static int listen_at(const char *name)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    int const made = socket(AF_UNIX, SOCK_DGRAM, 0);
    memcpy(at.sun_path, name, strlen(name));
    at.sun_path[0] = name[0] == '@' ? '\0' : name[0];
    if (made < 0 || bind(made, (const struct sockaddr *)&at,
                         (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(name))) != 0)
        abort();
    return made;
}

/* What has arrived; empty: nothing. */
static const char *received(int from)
{
    static char text[64];
    ssize_t const n = recv(from, text, sizeof text - 1, MSG_DONTWAIT);
    text[n < 0 ? 0 : n] = '\0';
    return text;
}

static void test_reports(const char *name)
{
    int const manager = listen_at(name);
    CHECK(setenv("NOTIFY_SOCKET", name, 1) == 0 && manager_listens());
    manager_report("READY=1");
    CHECK(strcmp(received(manager), "READY=1") == 0);
    no_socket = true;
    manager_report("WATCHDOG=1"); /* is lost, and does no harm */
    no_socket = false;
    CHECK(strcmp(received(manager), "") == 0);
    manager_report("STOPPING=1");
    CHECK(strcmp(received(manager), "STOPPING=1") == 0);
    close(manager);
}

static void test_no_manager(void)
{
    char longest[200];
    memset(longest, 'x', sizeof longest);
    longest[0] = '/';
    longest[sizeof longest - 1] = '\0';
    CHECK(unsetenv("NOTIFY_SOCKET") == 0 && !manager_listens());
    manager_report("READY=1");
    CHECK(setenv("NOTIFY_SOCKET", "relative", 1) == 0 && !manager_listens());
    manager_report("READY=1");
    CHECK(setenv("NOTIFY_SOCKET", longest, 1) == 0);
    manager_report("READY=1"); /* no address can hold it */
}

int main(void)
{
    char name[64] = P_tmpdir "/gait_manager_XXXXXX", abstract[80];
    if (!mkdtemp(name))
        abort();
    snprintf(abstract, sizeof abstract, "@%s", name);
    test_reports(abstract);
    strcat(name, "/socket");
    test_reports(name);
    unlink(name);
    *strrchr(name, '/') = '\0';
    rmdir(name);
    test_no_manager();
    return CHECK_DONE();
}
