/* fields.h - checked access to the keys of a small JSON file: every fault is one line naming file, key and remedy. */
#ifndef TRACKD_FIELDS_H
#define TRACKD_FIELDS_H
#include "file.h"
#include "json.h"

#include <stdint.h>

enum { FIELDS_NODES = 256 };

typedef struct fields {
    const char *path;
    json_doc doc;
    json_node node[FIELDS_NODES];
    file_bytes bytes;
} fields;

/* Read the file, which must hold one JSON object; `what` names its kind.  Close it again in every case. */
bool fields_open(fields *f, const char *path, const char *what, message *why);
void fields_close(fields *f);

/* Value of `key` of `object` (0: the whole file), or -1. */
int fields_find(const fields *f, int object, const char *key);
/* Exactly `count` numbers in [low, high] under the key, nested or not; the remedy ends the line of failure. */
bool fields_numbers(const fields *f, int object, const char *key, double *out, int count, double low,
                    double high, const char *remedy, message *why);
/* One whole number in [low, high] under a key of the file. */
bool fields_whole(const fields *f, const char *key, int64_t *out, double low, double high, const char *remedy,
                  message *why);
/* Every key of `object` must be one of the `count` known ones, and there once. */
bool fields_only(const fields *f, int object, const char *const *known, int count, message *why);
#endif
