/* manager.h - what a service manager is told (systemd's sd_notify protocol, without its library). */
#ifndef TRACKD_MANAGER_H
#define TRACKD_MANAGER_H
#include <stdbool.h>

/* Whether a service manager started this program and listens ($NOTIFY_SOCKET). */
bool manager_listens(void);
/* Tell it, "READY=1"; nothing happens where none listens. */
void manager_tell(const char *state);
#endif
