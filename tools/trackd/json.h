/* json.h - strict JSON (RFC 8259), and checked access to the keys of a small JSON file. */
#ifndef TRACKD_JSON_H
#define TRACKD_JSON_H
#include "common.h"

#include <stddef.h>
#include <stdint.h>

/* ---- strict JSON (RFC 8259), parsed into the caller's nodes; strings are checked, but escapes are not replaced.  NaN and
 * Infinity, which JSON does not have, become NAN, so that the reader of a key can reject them by name. */
typedef enum json_type { JSON_NULL, JSON_BOOL, JSON_NUMBER, JSON_STRING, JSON_ARRAY, JSON_OBJECT } json_type;

/* One value; its parts follow it.  An object's parts are key, value, key, value. */
typedef struct json_node {
    json_type type;
    int next;         /* index of the node after this value and all its parts */
    int line;         /* in the text, from 1 */
    double number;    /* JSON_NUMBER, may be NAN; JSON_BOOL: 0 or 1 */
    const char *text; /* JSON_STRING: between the quotes, not terminated */
    size_t length;
} json_node;

typedef struct json_doc {
    json_node *node; /* node[0] is the whole text */
    int used, cap;
} json_doc;

/* Parse a NUL-terminated text.  On failure `why` is "line N: ...". */
bool json_parse(json_doc *doc, json_node *nodes, int cap, const char *text, message *why);
/* Value of a key of an object, or -1. */
int json_find(const json_doc *doc, int object, const char *key);
/* Copy the numbers of a value: one number, or an array of them, nested or not.  Returns how many there are (also
 * beyond cap), or -1 if anything else is in it. */
int json_numbers(const json_doc *doc, int value, double *out, int cap);

/* ---- checked access to the keys of a small JSON file: every fault is one line naming file, key and remedy. */
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

/* Exactly `count` numbers in [low, high] under the key, nested or not; the remedy ends the line of failure. */
bool fields_numbers(const fields *f, int object, const char *key, double *out, int count, double low,
                    double high, const char *remedy, message *why);
/* One whole number in [low, high] under a key of the file. */
bool fields_whole(const fields *f, const char *key, int64_t *out, double low, double high, const char *remedy,
                  message *why);
/* Every key of `object` must be one of the `count` known ones, and there once. */
bool fields_only(const fields *f, int object, const char *const *known, int count, message *why);
#endif
