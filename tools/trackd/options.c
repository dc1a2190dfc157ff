#include "options.h"

#include "common.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool set_number(const option *o, const char *text, message *why)
{
    char *end;
    errno = 0;
    double const value = strtod(text, &end);
    bool const fits = value >= o->low && value <= o->high; /* false for NaN */
    if (end == text || *end || !fits || (o->kind == OPTION_INT && value != (double)(int32_t)value))
        return message_set(why,
                           o->kind == OPTION_INT ? "--%s %s: give a whole number from %.0f to %.0f"
                                                 : "--%s %s: give a number from %g to %g",
                           o->name, text, o->low, o->high);
    if (o->kind == OPTION_INT)
        *(int32_t *)o->value = (int32_t)value;
    else if (o->kind == OPTION_DOUBLE)
        *(double *)o->value = value;
    else
        *(float *)o->value = (float)value;
    return true;
}

static bool set_u64(const option *o, const char *text, message *why)
{
    char *end;
    errno = 0;
    uint64_t const value = strtoull(text, &end, 10);
    if (end == text || *end || errno || strchr(text, '-'))
        return message_set(why, "--%s %s: give a whole number from 0 to %" PRIu64, o->name, text, UINT64_MAX);
    *(uint64_t *)o->value = value;
    return true;
}

static bool set_flag(const option *o, const char *text, message *why)
{
    bool const yes = !text || strcmp(text, "true") == 0 || strcmp(text, "yes") == 0;
    if (!yes && strcmp(text, "false") != 0 && strcmp(text, "no") != 0)
        return message_set(why, "--%s %s: give true or false", o->name, text);
    *(bool *)o->value = yes;
    return true;
}

static bool set_text(const option *o, const char *text, message *why)
{
    if (!*text || strlen(text) >= OPTION_TEXT)
        return message_set(why, "--%s: give a value of 1 to %d characters", o->name, OPTION_TEXT - 1);
    strcpy(o->value, text);
    return true;
}

static bool set(const option *o, const char *text, message *why)
{
    if (o->kind == OPTION_FLAG)
        return set_flag(o, text, why);
    if (!text)
        return message_set(why, "--%s needs a value %s", o->name, o->metavar);
    if (o->kind == OPTION_TEXTUAL)
        return set_text(o, text, why);
    return o->kind == OPTION_U64 ? set_u64(o, text, why) : set_number(o, text, why);
}

static const option *find(const option *table, int count, const char *name, size_t length)
{
    for (int i = 0; i < count; i++)
        if (strlen(table[i].name) == length && memcmp(table[i].name, name, length) == 0)
            return &table[i];
    return NULL;
}

static const option *find_letter(const option *table, int count, char letter)
{
    for (int i = 0; i < count; i++)
        if (table[i].letter && table[i].letter == letter)
            return &table[i];
    return NULL;
}

/* The option that an argument names, and the value attached by "=". */
static const option *recognise(const option *table, int count, const char *arg, const char **attached)
{
    *attached = NULL;
    if (arg[0] == '-' && arg[1] == '-') {
        const char *const equals = strchr(arg, '=');
        *attached = equals ? equals + 1 : NULL;
        return find(table, count, arg + 2, equals ? (size_t)(equals - arg - 2) : strlen(arg + 2));
    }
    return arg[0] == '-' && arg[1] && !arg[2] ? find_letter(table, count, arg[1]) : NULL;
}

option_result options_parse(const option *table, int count, int argc, char **argv, message *why)
{
    for (int i = 1; i < argc; i++) {
        const char *value;
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0)
            return OPTION_HELP;
        const option *const o = recognise(table, count, argv[i], &value);
        if (!o) {
            message_set(why, "unknown argument %s; --help lists the options", argv[i]);
            return OPTION_BAD;
        }
        if (!value && o->kind != OPTION_FLAG && i + 1 < argc)
            value = argv[++i];
        if (!set(o, value, why))
            return OPTION_BAD;
    }
    return OPTION_OK;
}

static char *trim(char *s)
{
    s += strspn(s, " \t\r");
    for (char *end = s + strlen(s); end > s && strchr(" \t\r", end[-1]);)
        *--end = '\0';
    return s;
}

typedef struct options_source { /* the file being read */
    int number;                 /* of the line */
    int given[OPTIONS_MOST];    /* line that sets an option; 0: none */
} options_source;

/* Whether this line may set the option. */
static bool claim(options_source *file, const option *o, int *given, message *why)
{
    if (strcmp(o->name, "config") == 0 || strcmp(o->name, "version") == 0)
        return message_set(why, "%s is allowed on the command line only", o->name);
    if (*given)
        return message_set(why, "%s is already given in line %d; remove one", o->name, *given);
    *given = file->number;
    return true;
}

/* End the line where a comment begins, which is not between quotes. */
static void cut_comment(char *line)
{
    char quote = '\0';
    for (char *c = line; *c; c++) {
        if (*c == '#' && !quote)
            *c = '\0';
        else if (quote ? *c == quote : *c == '"' || *c == '\'')
            quote = quote ? '\0' : *c;
        if (!*c)
            return;
    }
}

static bool is_quoted(const char *value)
{
    return value[0] == '"' || value[0] == '\'';
}

/* The text of a TOML string; NULL: it is none, has escapes, or its quotes do not close. */
static const char *unquote(char *value)
{
    size_t const n = strlen(value);
    char const quote = value[0];
    if (!is_quoted(value) || n < 2 || value[n - 1] != quote || memchr(value + 1, quote, n - 2) ||
        (quote == '"' && strchr(value, '\\')))
        return NULL;
    value[n - 1] = '\0';
    return value + 1;
}

/* Whether a number that C can read is also one of TOML: decimal, with digits on both sides of a point and no 0 before others. */
static bool is_decimal(const char *text)
{
    static const char digits[] = "0123456789";
    text += *text == '-' || *text == '+';
    size_t n = strspn(text, digits);
    bool ok = n == 1 || (n > 1 && *text != '0');
    text += n;
    if (*text == '.') {
        n = strspn(++text, digits);
        ok = ok && n > 0;
        text += n;
    }
    return ok && (!*text || *text == 'e' || *text == 'E');
}

/* Set an option to a value as TOML writes its kind. */
static bool set_toml(const option *o, char *value, message *why)
{
    if (o->kind == OPTION_TEXTUAL) {
        const char *const text = unquote(value);
        return text ? set_text(o, text, why)
                    : message_set(why, "%s: give a string in plain quotes, without escapes", o->name);
    }
    if (is_quoted(value))
        return message_set(why, "%s: give the value without quotes", o->name);
    if (o->kind == OPTION_FLAG)
        return (strcmp(value, "yes") != 0 && strcmp(value, "no") != 0 && set_flag(o, value, why)) ||
               message_set(why, "--%s %s: give true or false", o->name, value);
    return set(o, value, why) &&
           (is_decimal(value) ||
            message_set(why, "--%s %s: give a number such as 12, 0.5 or 1e-3", o->name, value));
}

/* Apply one line of the file; modifies the line. */
static bool apply_line(const option *table, int count, options_source *file, char *line, message *why)
{
    cut_comment(line);
    line = trim(line);
    if (!*line)
        return true;
    char *const equals = strchr(line, '=');
    if (!equals)
        return message_set(why, "'%s' is not of the form name = value", line);
    *equals = '\0';
    const char *const name = trim(line);
    const option *const o = find(table, count, name, strlen(name));
    if (!o)
        return message_set(why, "unknown option %s; --help lists them", name);
    return claim(file, o, &file->given[o - table], why) && set_toml(o, trim(equals + 1), why);
}

/* Control characters are refused, because error messages would pass them on to the terminal. */
static bool is_text(const file_bytes *bytes)
{
    for (size_t k = 0; k < bytes->size; k++)
        if ((bytes->data[k] < ' ' && !memchr("\t\r\n", bytes->data[k], 3)) || bytes->data[k] == 127)
            return false;
    return true;
}

bool options_file(const option *table, int count, const char *path, message *why)
{
    file_bytes bytes;
    message bad;
    bool ok = true;
    options_source file = {0};
    if (!file_read(path, "configuration", FILE_MOST, &bytes, why))
        return false;
    if (!is_text(&bytes)) {
        free(bytes.data);
        return message_set(why, "%.100s: not a text file; give lines `name = value`", path);
    }
    char *line = (char *)bytes.data;
    line += strncmp(line, "\xef\xbb\xbf", 3) == 0 ? 3 : 0; /* a byte order mark */
    while (ok && line) {
        char *const end = strchr(line, '\n');
        if (end)
            *end = '\0';
        file.number++;
        ok = apply_line(table, count, &file, line, &bad) ||
             message_set(why, "%.100s: line %d: %.120s", path, file.number, bad.text);
        line = end ? end + 1 : NULL;
    }
    free(bytes.data);
    return ok;
}

void options_help(const option *table, int count)
{
    for (int i = 0; i < count; i++) {
        const option *const o = &table[i];
        char letter[8] = "";
        if (o->letter)
            snprintf(letter, sizeof letter, "-%c, ", o->letter);
        printf("  %s--%s%s%s\n        %s\n", letter, o->name, *o->metavar ? " " : "", o->metavar, o->help);
    }
    printf("  -h, --help\n        show this text\n");
}
