/* log_scan.h - is an LCM log whole? */
#ifndef TRACKD_LOG_SCAN_H
#define TRACKD_LOG_SCAN_H
#include "message.h"

#include <stdint.h>

/* Number of whole messages up to where the log ends or breaks off, -1 for what is no regular file; `why` says that it is
 * empty or breaks off, or nothing. */
int64_t log_scan(const char *path, message *why);
#endif
