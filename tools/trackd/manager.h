/* manager.h - what is reported to a service manager (systemd's sd_notify protocol, without its library). */
#ifndef TRACKD_MANAGER_H
#define TRACKD_MANAGER_H
#include <stdbool.h>

/* Whether a service manager started this program and listens ($NOTIFY_SOCKET). */
bool manager_listens(void);
/* Report a state to it, "READY=1"; nothing happens where none listens. */
void manager_report(const char *state);
#endif
