/* message.h - one line saying what went wrong, filled by whoever notices first. */
#ifndef TRACKD_MESSAGE_H
#define TRACKD_MESSAGE_H
#include <stdbool.h>

typedef struct message {
    char text[256];
} message;

/* Write the line; always returns false, so that a caller can end with `return message_set(...)`. */
bool message_set(message *m, const char *format, ...) __attribute__((format(printf, 2, 3)));
#endif
