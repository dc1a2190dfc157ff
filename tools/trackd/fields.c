#include "fields.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool fields_open(fields *f, const char *path, const char *what, message *why)
{
    message bad;
    f->path = path;
    f->doc = (json_doc){0};
    if (!file_read(path, what, &f->bytes, why))
        return false;
    const char *const text = (const char *)f->bytes.data;
    if (strlen(text) != f->bytes.size)
        return message_set(why, "%s: not valid JSON (a zero byte in it); write the %s anew", path, what);
    if (!json_parse(&f->doc, f->node, FIELDS_NODES, text, &bad))
        return message_set(why, "%s: not valid JSON (%s); mend it or write the %s anew", path, bad.text,
                           what);
    if (f->node[0].type != JSON_OBJECT)
        return message_set(why, "%s: holds no JSON object; the %s is an object of keys in braces", path,
                           what);
    return true;
}

void fields_close(fields *f)
{
    free(f->bytes.data);
    f->bytes = (file_bytes){0};
}

int fields_find(const fields *f, int object, const char *key)
{
    return json_find(&f->doc, object, key);
}

bool fields_numbers(const fields *f, int object, const char *key, double *out, int count, double low,
                    double high, const char *remedy, message *why)
{
    char name[64];
    int const value = fields_find(f, object, key);
    if (object > 0) /* its own key stands before it */
        snprintf(name, sizeof name, "%.*s.%s", (int)f->node[object - 1].length, f->node[object - 1].text,
                 key);
    else
        snprintf(name, sizeof name, "%s", key);
    if (value < 0)
        return message_set(why, "%s: %s is missing; %s", f->path, name, remedy);
    int const found = json_numbers(&f->doc, value, out, count);
    if (found < 0)
        return message_set(why, "%s: %s is not made of numbers; %s", f->path, name, remedy);
    if (found != count)
        return message_set(why, "%s: %s has %d numbers, not %d; %s", f->path, name, found, count, remedy);
    for (int i = 0; i < count; i++)
        if (!isfinite(out[i]))
            return message_set(why, "%s: %s is not finite; %s", f->path, name, remedy);
        else if (out[i] < low || out[i] > high)
            return message_set(why, "%s: %s is %g, outside [%g, %g]; %s", f->path, name, out[i], low, high,
                               remedy);
    return true;
}

bool fields_whole(const fields *f, const char *key, int64_t *out, double low, double high, const char *remedy,
                  message *why)
{
    double value;
    if (!fields_numbers(f, 0, key, &value, 1, low, high, remedy, why))
        return false;
    if (value != floor(value))
        return message_set(why, "%s: %s is %g, no whole number; %s", f->path, key, value, remedy);
    *out = (int64_t)value;
    return true;
}

bool fields_only(const fields *f, int object, const char *const *known, int count, message *why)
{
    for (int i = object + 1; i < f->node[object].next; i = f->node[i + 1].next) {
        bool found = false;
        for (int k = 0; k < count && !found; k++)
            found = strlen(known[k]) == f->node[i].length &&
                    memcmp(known[k], f->node[i].text, f->node[i].length) == 0;
        if (!found)
            return message_set(why, "%s: line %d: %.*s is not a known key; correct or remove it", f->path,
                               f->node[i].line, (int)f->node[i].length, f->node[i].text);
        for (int k = f->node[i + 1].next; k < f->node[object].next; k = f->node[k + 1].next)
            if (f->node[k].length == f->node[i].length &&
                memcmp(f->node[k].text, f->node[i].text, f->node[i].length) == 0)
                return message_set(why, "%s: line %d: %.*s is there twice; remove one", f->path,
                                   f->node[k].line, (int)f->node[k].length, f->node[k].text);
    }
    return true;
}
