#include "json.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- json ---- */
enum { MAX_DEPTH = 16 };

typedef struct parser {
    json_doc *doc;
    const char *at;
    int line;
    message *why;
} parser;

static bool parse_value(parser *p, int depth);

static bool fail(parser *p, const char *what)
{
    return message_set(p->why, "line %d: %s", p->line, what);
}

static void skip_space(parser *p)
{
    for (; *p->at == ' ' || *p->at == '\t' || *p->at == '\r' || *p->at == '\n'; p->at++)
        p->line += *p->at == '\n';
}

/* Skip white space and one expected character. */
static bool take(parser *p, char c)
{
    skip_space(p);
    if (*p->at != c)
        return false;
    p->at++;
    return true;
}

/* Append a node; returns its index, or -1 if there are more than the caller has space for. */
static int add(parser *p, json_type type)
{
    if (p->doc->used == p->doc->cap) {
        fail(p, "more values than any file of this kind has");
        return -1;
    }
    int const i = p->doc->used++;
    p->doc->node[i] = (json_node){.type = type, .next = i + 1, .line = p->line, .text = p->at};
    return i;
}

static bool is_hex(char c)
{
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F');
}

/* Length of the escape at s, which points at the backslash; 0 if it is none. */
static int escape_length(const char *s)
{
    if (s[1] == 'u')
        return is_hex(s[2]) && is_hex(s[3]) && is_hex(s[4]) && is_hex(s[5]) ? 6 : 0;
    return s[1] && strchr("\"\\/bfnrt", s[1]) ? 2 : 0;
}

static bool parse_string(parser *p)
{
    if (!take(p, '"'))
        return fail(p, "expected a string in double quotes");
    int const i = add(p, JSON_STRING);
    if (i < 0)
        return false;
    while (*p->at != '"') {
        int const step = *p->at == '\\' ? escape_length(p->at) : (unsigned char)*p->at >= 0x20;
        if (!step)
            return fail(p, *p->at == '\\' ? "unknown escape in a string" : "string without closing quote");
        p->at += step;
    }
    p->doc->node[i].length = (size_t)(p->at - p->doc->node[i].text);
    p->at++;
    return true;
}

static const char *skip_digits(const char *s)
{
    while (*s >= '0' && *s <= '9')
        s++;
    return s;
}

/* End of a number by JSON's grammar (no leading zeros, no hex, no "nan"); NULL if s does not start with one. */
static const char *number_end(const char *s)
{
    s += *s == '-';
    const char *const whole = s;
    s = *s == '0' ? s + 1 : skip_digits(s);
    if (s == whole)
        return NULL;
    if (*s == '.') {
        const char *const fraction = s + 1;
        s = skip_digits(fraction);
        if (s == fraction)
            return NULL;
    }
    if (*s == 'e' || *s == 'E') {
        const char *const exponent = s + 1 + (s[1] == '+' || s[1] == '-');
        s = skip_digits(exponent);
        if (s == exponent)
            return NULL;
    }
    return s;
}

/* End of NaN or Infinity as Python's json writes them; NULL if s starts with neither. */
static const char *not_finite_end(const char *s)
{
    s += *s == '-';
    return strncmp(s, "NaN", 3) == 0 ? s + 3 : strncmp(s, "Infinity", 8) == 0 ? s + 8 : NULL;
}

static bool parse_number(parser *p)
{
    const char *const special = not_finite_end(p->at), *const end = special ? special : number_end(p->at);
    int const i = end ? add(p, JSON_NUMBER) : -1;
    if (!end)
        return fail(p, "expected a value");
    if (i < 0)
        return false;
    p->doc->node[i].number = special ? (double)NAN : strtod(p->at, NULL);
    if (!special && !isfinite(p->doc->node[i].number))
        return fail(p, "number too large");
    p->at = end;
    return true;
}

static bool parse_word(parser *p)
{
    static const struct {
        const char *word;
        json_type type;
        double number;
    } words[] = {{"null", JSON_NULL, 0}, {"true", JSON_BOOL, 1}, {"false", JSON_BOOL, 0}};
    for (size_t w = 0; w < sizeof words / sizeof *words; w++) {
        size_t const length = strlen(words[w].word);
        if (strncmp(p->at, words[w].word, length) == 0) {
            int const i = add(p, words[w].type);
            if (i < 0)
                return false;
            p->doc->node[i].number = words[w].number;
            p->at += length;
            return true;
        }
    }
    return fail(p, "expected a value");
}

static bool parse_members(parser *p, json_type type, char close, int depth)
{
    int const i = add(p, type);
    if (i < 0)
        return false;
    p->at++;
    if (!take(p, close)) {
        do {
            if (type == JSON_OBJECT && (!parse_string(p) || (!take(p, ':') && !fail(p, "expected a colon"))))
                return false;
            if (!parse_value(p, depth + 1))
                return false;
        } while (take(p, ','));
        if (!take(p, close))
            return fail(p, close == '}' ? "expected a comma or }" : "expected a comma or ]");
    }
    p->doc->node[i].next = p->doc->used;
    return true;
}

static bool parse_value(parser *p, int depth)
{
    skip_space(p);
    if (depth > MAX_DEPTH)
        return fail(p, "nested too deeply");
    switch (*p->at) {
    case '{':
        return parse_members(p, JSON_OBJECT, '}', depth);
    case '[':
        return parse_members(p, JSON_ARRAY, ']', depth);
    case '"':
        return parse_string(p);
    case 'n':
    case 't':
    case 'f':
        return parse_word(p);
    default:
        return parse_number(p);
    }
}

bool json_parse(json_doc *doc, json_node *nodes, int cap, const char *text, message *why)
{
    *doc = (json_doc){.node = nodes, .cap = cap};
    parser p = {.doc = doc, .at = text, .line = 1, .why = why};
    if (!parse_value(&p, 0))
        return false;
    skip_space(&p);
    return *p.at == '\0' || fail(&p, "text after the end of the value");
}

int json_find(const json_doc *doc, int object, const char *key)
{
    size_t const length = strlen(key);
    for (int i = object + 1; i < doc->node[object].next; i = doc->node[i + 1].next)
        if (doc->node[i].length == length && memcmp(doc->node[i].text, key, length) == 0)
            return i + 1;
    return -1;
}

int json_numbers(const json_doc *doc, int value, double *out, int cap)
{
    int count = 0;
    for (int i = value; i < doc->node[value].next; i++) {
        if (doc->node[i].type == JSON_NUMBER && count < cap)
            out[count] = doc->node[i].number;
        if (doc->node[i].type != JSON_NUMBER && doc->node[i].type != JSON_ARRAY)
            return -1;
        count += doc->node[i].type == JSON_NUMBER;
    }
    return count;
}

/* ---- fields ---- */
bool fields_open(fields *f, const char *path, const char *what, message *why)
{
    message bad;
    f->path = path;
    f->doc = (json_doc){0};
    if (!file_read(path, what, FILE_MOST, &f->bytes, why))
        return false;
    const char *const text = (const char *)f->bytes.data;
    if (strlen(text) != f->bytes.size)
        return message_set(why, "%s: not valid JSON (it contains a zero byte); write the %s file again", path,
                           what);
    if (!json_parse(&f->doc, f->node, FIELDS_NODES, text, &bad))
        return message_set(why, "%s: not valid JSON (%s); correct it or write the %s file again", path,
                           bad.text, what);
    if (f->node[0].type != JSON_OBJECT)
        return message_set(why, "%s: not a JSON object; a %s file is an object of keys in braces", path,
                           what);
    return true;
}

void fields_close(fields *f)
{
    free(f->bytes.data);
    f->bytes = (file_bytes){0};
}

bool fields_numbers(const fields *f, int object, const char *key, double *out, int count, double low,
                    double high, const char *remedy, message *why)
{
    char name[64];
    int const value = json_find(&f->doc, object, key);
    if (object > 0) /* its key precedes it */
        snprintf(name, sizeof name, "%.*s.%s", (int)f->node[object - 1].length, f->node[object - 1].text,
                 key);
    else
        snprintf(name, sizeof name, "%s", key);
    if (value < 0)
        return message_set(why, "%s: %s is missing; %s", f->path, name, remedy);
    int const found = json_numbers(&f->doc, value, out, count);
    if (found < 0)
        return message_set(why, "%s: %s is not numeric; %s", f->path, name, remedy);
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
    double value = 0;
    if (!fields_numbers(f, 0, key, &value, 1, low, high, remedy, why))
        return false;
    if (value != floor(value))
        return message_set(why, "%s: %s is %g, not a whole number; %s", f->path, key, value, remedy);
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
                return message_set(why, "%s: line %d: %.*s is given twice; remove one", f->path,
                                   f->node[k].line, (int)f->node[k].length, f->node[k].text);
    }
    return true;
}
